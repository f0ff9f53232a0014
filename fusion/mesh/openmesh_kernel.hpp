#pragma once

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <cstddef>

#include "fusion/base/vertex_types.hpp"

/// What OpenMesh wants to know of a point type.
template <>
struct OpenMesh::vector_traits<spectra::base::Vec3f> {
  using vector_type = spectra::base::Vec3f;
  using value_type = float;
  static const std::size_t size_ = 3;
  static std::size_t size() { return size_; }
};

namespace spectra::mesh {

/// Our vertex types inside OpenMesh, so that its property arrays can be seen as spans of them without a cast.
struct MeshTraits : OpenMesh::DefaultTraits {
  using Point = base::Vec3f;
  using Color = base::Rgb8;
};

/// OpenMesh's array kernel for triangles with its attribute arrays: TriMesh_ArrayKernelT without the geometry
/// functions, which would ask for arithmetic on the point type. For sources that link OpenMesh only.
using MeshKernel = OpenMesh::AttribKernelT<OpenMesh::FinalMeshItemsT<MeshTraits, true>, OpenMesh::TriConnectivity>;

}  // namespace spectra::mesh
