#include "fusion/mesh/multispectral_mesh.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "fusion/mesh/openmesh_kernel.hpp"

namespace spectra::mesh {

struct MultispectralMesh::Storage {
  MeshKernel kernel;
  OpenMesh::VPropHandleT<base::Rgb8> visible;
  OpenMesh::VPropHandleT<float> temperature;

  Storage() {
    kernel.add_property(visible, "visible");
    kernel.add_property(temperature, "temperature_celsius");
  }

  std::vector<base::Vec3f>& positions() { return kernel.property(kernel.points_property_handle()).data_vector(); }
  std::vector<base::Rgb8>& visible_colours() { return kernel.property(visible).data_vector(); }
  std::vector<float>& temperatures() { return kernel.property(temperature).data_vector(); }
};

MultispectralMesh::MultispectralMesh() : storage_(std::make_unique<Storage>()) {}
MultispectralMesh::~MultispectralMesh() = default;
MultispectralMesh::MultispectralMesh(MultispectralMesh&&) noexcept = default;
MultispectralMesh& MultispectralMesh::operator=(MultispectralMesh&&) noexcept = default;

std::size_t MultispectralMesh::vertex_count() const {
  return storage_ ? storage_->kernel.n_vertices() : 0;
}

void MultispectralMesh::resize_vertices(std::size_t count) {
  if (!storage_) storage_ = std::make_unique<Storage>();
  const auto old_count = static_cast<std::ptrdiff_t>(std::min(vertex_count(), count));
  storage_->kernel.resize(count, 0, 0);
  auto& colours = storage_->visible_colours();
  std::fill(colours.begin() + old_count, colours.end(), kNoColour);
  auto& temperatures = storage_->temperatures();
  std::fill(temperatures.begin() + old_count, temperatures.end(), std::numeric_limits<float>::quiet_NaN());
  if (!confidence.empty()) {
    confidence.sigma_kelvin.resize(count, std::numeric_limits<float>::quiet_NaN());
    confidence.looked_at.resize(count, std::numeric_limits<double>::quiet_NaN());
  }
}

std::span<const base::Vec3f> MultispectralMesh::positions() const {
  return storage_ ? std::span<const base::Vec3f>(storage_->positions()) : std::span<const base::Vec3f>();
}
std::span<base::Vec3f> MultispectralMesh::positions() {
  return storage_ ? std::span<base::Vec3f>(storage_->positions()) : std::span<base::Vec3f>();
}
std::span<const base::Rgb8> MultispectralMesh::visible() const {
  return storage_ ? std::span<const base::Rgb8>(storage_->visible_colours()) : std::span<const base::Rgb8>();
}
std::span<base::Rgb8> MultispectralMesh::visible() {
  return storage_ ? std::span<base::Rgb8>(storage_->visible_colours()) : std::span<base::Rgb8>();
}
std::span<const float> MultispectralMesh::temperature_celsius() const {
  return storage_ ? std::span<const float>(storage_->temperatures()) : std::span<const float>();
}
std::span<float> MultispectralMesh::temperature_celsius() {
  return storage_ ? std::span<float>(storage_->temperatures()) : std::span<float>();
}

}  // namespace spectra::mesh
