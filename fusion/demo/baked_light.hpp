#pragma once

#include <vector>

#include "fusion/demo/depth_image.hpp"

namespace spectra::demo {

/// Unit normals of the vertices, from the triangles around each.
std::vector<base::Vec3f> vertex_normals(const SurfaceMesh& mesh);

/// Soft daylight with shadows, found once on a stand-in of the scene and then asked at any point of it.
class BakedLight {
 public:
  explicit BakedLight(const SurfaceMesh& stand_in);

  /// Red, green and blue light at a point with this normal: about 1 on an open floor.
  Colour at(Vec position, Vec normal) const;

 private:
  struct Source {
    Vec towards, right, up;
    Colour strength;
    DepthImage shadow;
  };
  double share_visible(const Source& source, Vec position) const;

  std::vector<Source> sources_;
};

}  // namespace spectra::demo
