#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "server/map/scene_snapshot.hpp"
#include "server/stream/camera.hpp"

namespace spectra::stream {

/// The tiles of a snapshot with their ties: who replaces whom. Tiles without vertices are left out; a tile's parent is
/// its nearest ancestor that is there.
class ViewTree {
 public:
  struct Node {
    std::shared_ptr<const map::Tile> tile;
    base::Bounds bounds;  ///< Of everything beneath, too.
    std::optional<std::size_t> parent;
    std::vector<std::size_t> children;
  };

  ViewTree() = default;
  explicit ViewTree(const map::SceneSnapshot& scene);

  /// Coarse before fine.
  const std::vector<Node>& nodes() const { return nodes_; }

 private:
  std::vector<Node> nodes_;
};

inline constexpr std::uint64_t kUnbounded = std::numeric_limits<std::uint64_t>::max();

/// A tile that a viewer needs.
struct SelectedTile {
  std::size_t node = 0;
  bool is_target = false;  ///< To be drawn in the end; otherwise it stands in for its children until all are there.
  bool is_in_view = true;
};

/// What a tile takes at a viewer who has decoded it: three floats and a colour of four bytes for each vertex, three
/// indices of four bytes for each triangle.
std::uint64_t decoded_bytes(const map::Tile& tile);

/// The tiles that a camera asks for, in sending order: coarse before fine; of one level those in view before others,
/// then by how much their lack is seen (in octaves of the error on the screen), and among equals the hottest first.
///
/// A tile is refined when it may be in view (the field of view widened by a tenth) and its geometric error, or the
/// half of the largest detail of colour or temperature that it shows wrong, seen from the nearest point of its bounds, covers more than
/// `pixel_error` pixels. All children of a refined tile are needed,
/// also those out of view, because a client replaces a tile only by all of its children. Without a camera every tile is
/// needed. All selected tiles together take at most `most_bytes`, decoded, unless the tops alone take more: tiles are refined
/// from the largest error on the screen downwards, and one whose children do not fit any more is left as it is.
std::vector<SelectedTile> selected_tiles(const ViewTree& tree, const std::optional<Camera>& camera, double pixel_error,
                                         std::uint64_t most_bytes = kUnbounded);

/// How far something on a tile may be from where it is in the full mesh, or half the size of the largest patch of another
/// colour or temperature (metres): whichever is seen from farther away.
double seen_error_m(const map::Tile& tile);

/// Size on the screen, in pixels, of something so large within `bounds`; infinite when the eye is inside.
double screen_error(const Camera& camera, const base::Bounds& bounds, double size_m);

/// False when nothing within `bounds` can be in view, the field of view widened by a tenth.
bool may_be_in_view(const Camera& camera, const base::Bounds& bounds);

/// A camera that selected_tiles() can use: finite, with a direction, a viewport and a field of view between 0 and 180.
bool is_usable(const Camera& camera);

}  // namespace spectra::stream
