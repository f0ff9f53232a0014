#include "fusion/demo/tessellator.hpp"

#include <algorithm>
#include <array>

namespace spectra::demo {
namespace {

std::uint8_t byte_of(double level) {
  return static_cast<std::uint8_t>(std::clamp(level + 0.5, 0.0, 255.0));
}

/// Coordinates across one axis of a bevelled box: even over the flat part, one or two more cells for each bevel.
std::vector<double> box_axis(double half, double bevel, std::uint64_t flat_cells, int bevel_cells) {
  std::vector<double> at;
  const double flat = half - bevel;
  for (int i = 0; i < bevel_cells; ++i) at.push_back(-half + bevel * i / bevel_cells);
  for (std::uint64_t i = 0; i <= flat_cells; ++i) {
    at.push_back(-flat + 2 * flat * static_cast<double>(i) / static_cast<double>(flat_cells));
  }
  for (int i = 1; i <= bevel_cells; ++i) at.push_back(flat + bevel * i / bevel_cells);
  return at;
}

}  // namespace

std::uint64_t Tessellator::cells(double length, double relative, std::uint64_t least) const {
  return std::max(least, static_cast<std::uint64_t>(length / (spacing_ * relative) + 0.5));
}

std::uint32_t Tessellator::add(const SurfacePoint& point) {
  mesh_->positions.push_back({static_cast<float>(point.position.x), static_cast<float>(point.position.y),
                              static_cast<float>(point.position.z)});
  mesh_->colours.push_back({byte_of(point.colour.r), byte_of(point.colour.g), byte_of(point.colour.b)});
  mesh_->celsius.push_back(static_cast<float>(point.celsius));
  mesh_->is_skin.push_back(point.is_skin ? 1 : 0);
  mesh_->dust.push_back(byte_of(point.dust * 255));
  mesh_->glow.push_back(byte_of(point.glow * 255));
  return static_cast<std::uint32_t>(mesh_->positions.size() - 1);
}

void Tessellator::quad(std::uint64_t a, std::uint64_t b, std::uint64_t c, std::uint64_t d, bool other_diagonal) {
  const auto i = static_cast<std::uint32_t>(a), j = static_cast<std::uint32_t>(b);
  const auto k = static_cast<std::uint32_t>(c), l = static_cast<std::uint32_t>(d);
  if (other_diagonal) {
    mesh_->triangles.push_back({i, j, l});
    mesh_->triangles.push_back({j, k, l});
  } else {
    mesh_->triangles.push_back({i, j, k});
    mesh_->triangles.push_back({i, k, l});
  }
}

void Tessellator::sheet(double width, double height, double relative, const SheetFunction& surface) {
  const std::uint64_t nu = cells(width, relative, 2), nv = cells(height, relative, 2);
  vertex_count_ += (nu + 1) * (nv + 1);
  if (!mesh_) return;
  const std::uint64_t base = mesh_->positions.size();
  for (std::uint64_t j = 0; j <= nv; ++j) {
    for (std::uint64_t i = 0; i <= nu; ++i) {
      add(surface(static_cast<double>(i) / static_cast<double>(nu), static_cast<double>(j) / static_cast<double>(nv)));
    }
  }
  for (std::uint64_t j = 0; j < nv; ++j) {
    for (std::uint64_t i = 0; i < nu; ++i) {
      const std::uint64_t a = base + j * (nu + 1) + i;
      quad(a, a + 1, a + nu + 2, a + nu + 1, ((i + j) & 1) != 0);
    }
  }
}

void Tessellator::tube(double around, double along, double relative, bool close_start, bool close_end,
                       const SheetFunction& surface) {
  const std::uint64_t nu = cells(around, relative, 5);
  const std::uint64_t nv = cells(along, relative, 3);
  const std::uint64_t first_row = close_start ? 1 : 0, last_row = close_end ? nv - 1 : nv;
  vertex_count_ += nu * (last_row - first_row + 1) + (close_start ? 1U : 0U) + (close_end ? 1U : 0U);
  if (!mesh_) return;
  const std::uint64_t base = mesh_->positions.size();
  for (std::uint64_t j = first_row; j <= last_row; ++j) {
    for (std::uint64_t i = 0; i < nu; ++i) {
      add(surface(static_cast<double>(i) / static_cast<double>(nu), static_cast<double>(j) / static_cast<double>(nv)));
    }
  }
  const std::uint64_t rows = last_row - first_row + 1;
  for (std::uint64_t j = 0; j + 1 < rows; ++j) {
    for (std::uint64_t i = 0; i < nu; ++i) {
      const std::uint64_t next = (i + 1) % nu;
      quad(base + j * nu + i, base + j * nu + next, base + (j + 1) * nu + next, base + (j + 1) * nu + i,
           ((i + j) & 1) != 0);
    }
  }
  if (close_start) {
    const std::uint32_t pole = add(surface(0, 0));
    for (std::uint64_t i = 0; i < nu; ++i) {
      mesh_->triangles.push_back(
          {pole, static_cast<std::uint32_t>(base + (i + 1) % nu), static_cast<std::uint32_t>(base + i)});
    }
  }
  if (close_end) {
    const std::uint32_t pole = add(surface(0, 1));
    const std::uint64_t row = base + (rows - 1) * nu;
    for (std::uint64_t i = 0; i < nu; ++i) {
      mesh_->triangles.push_back(
          {pole, static_cast<std::uint32_t>(row + i), static_cast<std::uint32_t>(row + (i + 1) % nu)});
    }
  }
}

void Tessellator::box(Vec half, double bevel, double relative, bool has_bottom, const BoxFunction& surface) {
  bevel = std::min(bevel, 0.8 * std::min({half.x, half.y, half.z}));
  const Vec flat{half.x - bevel, half.y - bevel, half.z - bevel};
  const int bevel_cells = bevel > 1.5 * spacing_ * relative ? 2 : 1;
  // The lattice runs x, z around and y up, so that the bottom is the first layer.
  const std::vector<double> xs = box_axis(half.x, bevel, cells(2 * flat.x, relative, 1), bevel_cells);
  const std::vector<double> ys = box_axis(half.y, bevel, cells(2 * flat.y, relative, 1), bevel_cells);
  const std::vector<double> zs = box_axis(half.z, bevel, cells(2 * flat.z, relative, 1), bevel_cells);
  const std::uint64_t nx = xs.size() - 1, ny = ys.size() - 1, nz = zs.size() - 1;
  const std::uint64_t ring = 2 * (nx + nz), inner = (nx - 1) * (nz - 1);
  vertex_count_ += ring * (ny + 1) + inner * (has_bottom ? 2 : 1);
  if (!mesh_) return;

  const auto add_at = [&](double x, double y, double z) {
    const Vec p{x, y, z};
    const Vec core{std::clamp(x, -flat.x, flat.x), std::clamp(y, -flat.y, flat.y), std::clamp(z, -flat.z, flat.z)};
    const Vec normal = normalised(p - core);
    add(surface(core + normal * bevel, normal));
  };
  const std::uint64_t base = mesh_->positions.size();
  for (std::uint64_t k = 0; k <= ny; ++k) {
    // Counter-clockwise seen from above: along +x at the front (z largest), then to the back, and round.
    for (std::uint64_t i = 0; i < nx; ++i) add_at(xs[i], ys[k], zs[nz]);
    for (std::uint64_t j = nz; j > 0; --j) add_at(xs[nx], ys[k], zs[j]);
    for (std::uint64_t i = nx; i > 0; --i) add_at(xs[i], ys[k], zs[0]);
    for (std::uint64_t j = 0; j < nz; ++j) add_at(xs[0], ys[k], zs[j]);
  }
  for (std::uint64_t k = 0; k < ny; ++k) {
    for (std::uint64_t i = 0; i < ring; ++i) {
      const std::uint64_t next = (i + 1) % ring;
      quad(base + k * ring + i, base + k * ring + next, base + (k + 1) * ring + next, base + (k + 1) * ring + i,
           ((i + k) & 1) != 0);
    }
  }
  const auto lid = [&](std::uint64_t layer) {
    const std::uint64_t inside = mesh_->positions.size();
    for (std::uint64_t j = 1; j < nz; ++j) {
      for (std::uint64_t i = 1; i < nx; ++i) add_at(xs[i], ys[layer], zs[j]);
    }
    const auto index = [&](std::uint64_t i, std::uint64_t j) {
      const std::uint64_t round = base + layer * ring;
      if (j == nz) return round + i;
      if (i == nx) return round + nx + (nz - j);
      if (j == 0) return round + nx + nz + (nx - i);
      if (i == 0) return round + 2 * nx + nz + j;
      return inside + (j - 1) * (nx - 1) + (i - 1);
    };
    for (std::uint64_t j = 0; j < nz; ++j) {
      for (std::uint64_t i = 0; i < nx; ++i) {
        const std::array<std::uint64_t, 4> at{index(i, j + 1), index(i + 1, j + 1), index(i + 1, j), index(i, j)};
        const bool other = ((i + j) & 1) != 0;
        if (layer == 0) {
          quad(at[3], at[2], at[1], at[0], other);
        } else {
          quad(at[0], at[1], at[2], at[3], other);
        }
      }
    }
  };
  lid(ny);
  if (has_bottom) lid(0);
}

}  // namespace spectra::demo
