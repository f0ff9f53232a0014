#include "server/stream/lattice.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "server/map/position_step.hpp"
#include "server/stream/stream_quality.hpp"

namespace spectra::stream {
namespace {

// So many steps of that length are exact in the 24 bits of a float, with those of the step itself.
double most_steps(float step_m) {
  int exponent = 0;
  auto significand = static_cast<std::uint32_t>(std::ldexp(std::frexp(step_m, &exponent), 24));
  significand >>= std::countr_zero(significand);
  return std::ldexp(1, 24 - static_cast<int>(std::bit_width(significand - 1)));
}

// How the coordinates of one tile are rounded.
class Rounding {
 public:
  Rounding(const map::Tile& tile, float step_m)
      : tile_(tile),
        step_m_(static_cast<double>(step_m)),
        most_steps_(most_steps(step_m)),
        drawn_(tile.positions.size()) {
    if (tile.triangles.empty()) drawn_.assign(drawn_.size(), true);
    for (const base::Triangle& triangle : tile.triangles) {
      for (const std::uint32_t v : triangle) drawn_[v] = true;
    }
    std::array<float, 3> low{}, high{};
    low.fill(std::numeric_limits<float>::infinity());
    high.fill(-std::numeric_limits<float>::infinity());
    for (std::size_t v = 0; v < drawn_.size(); ++v) {
      if (!drawn_[v]) continue;
      const std::array<float, 3> p = coordinates(v);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], p[axis]);
        high[axis] = std::max(high[axis], p[axis]);
      }
    }
    double extent = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) extent = std::max(extent, double{high[axis]} - double{low[axis]});
    // Vertices of coarser steps than others may be rounded beyond the box, by half of theirs at each end.
    if (const auto asked = fewest_and_most_asked(); asked[0] < asked[1]) extent += this->step_m(asked[0]);
    constexpr int kSmallestExponent = -124;
    most_halvings_ =
        halvings_within(extent, std::ilogb(step_m) - kSmallestExponent, std::min(most_steps_, map::kStepsOfTile));
  }

  bool is_drawn(std::size_t v) const { return drawn_[v]; }

  std::array<float, 3> coordinates(std::size_t v) const {
    const base::Vec3f& position = tile_.positions[v];
    return {position.x, position.y, position.z};
  }

  // Of one coordinate of a vertex; negative: doublings.
  int halvings(std::size_t v, std::size_t axis) const {
    const int wanted = tile_.step_halvings.empty() ? 0 : int{tile_.step_halvings[v][axis]};
    return halvings_within(static_cast<double>(std::abs(coordinates(v)[axis])), std::min(wanted, most_halvings_),
                           most_steps_);
  }

  double step_m(int halvings) const { return std::ldexp(step_m_, -halvings); }

 private:
  // Halvings of drawn vertices.
  std::array<int, 2> fewest_and_most_asked() const {
    std::array<int, 2> asked{tile_.step_halvings.empty() ? 0 : std::numeric_limits<int>::max(), 0};
    for (std::size_t v = 0; v < tile_.step_halvings.size(); ++v) {
      if (!drawn_[v]) continue;
      for (const std::uint8_t halvings : tile_.step_halvings[v]) {
        asked = {std::min(asked[0], int{halvings}), std::max(asked[1], int{halvings})};
      }
    }
    return asked;
  }

  // As many, and few enough for so many metres.
  int halvings_within(double length_m, int wanted, double most_steps) const {
    while (std::isfinite(length_m) && length_m > step_m(wanted) * (most_steps - 2)) {
      wanted = std::min(wanted - 1, static_cast<int>(std::floor(std::log2(step_m_ * most_steps / length_m))));
    }
    return wanted;
  }

  const map::Tile& tile_;
  double step_m_;
  double most_steps_;
  int most_halvings_ = 0;
  std::vector<bool> drawn_;
};

// Of a tile that lies within a box: whether floats tell its steps apart wherever in the box a vertex is.
bool is_told_apart(const base::Bounds& box, double step_m, double most_steps) {
  for (const auto member : {&base::Vec3f::x, &base::Vec3f::y, &base::Vec3f::z}) {
    const auto low = static_cast<double>(box.min.*member), high = static_cast<double>(box.max.*member);
    const double furthest = std::max(std::abs(low), std::abs(high));
    if (!(furthest <= step_m * (most_steps - 2))) return false;
    if (!(high - low <= step_m * (std::min(most_steps, map::kStepsOfTile) - 2))) return false;
  }
  return true;
}

}  // namespace

float lattice_step(double wanted_m) {
  constexpr double kSmallest = 4 * static_cast<double>(std::numeric_limits<float>::min());
  constexpr double kLargest = 7 * 0x1p124;
  if (!(wanted_m > kSmallest)) return static_cast<float>(kSmallest);
  if (wanted_m >= kLargest) return static_cast<float>(kLargest);
  int exponent = 0;
  const double fraction = std::frexp(wanted_m, &exponent);  // [0.5, 1): eight times that is 4 .. 7 and a remainder
  return static_cast<float>(std::ldexp(std::floor(8 * fraction), exponent - 3));
}

float position_step_in_force(float wanted_m, float suggested_m) {
  return lattice_step(static_cast<double>(wanted_m > 0 ? wanted_m : suggested_m));
}

float coarsest_step(const map::SceneSnapshot& scene, float step_m) {
  const auto step = static_cast<double>(step_m);
  const double most = most_steps(step_m);
  double coarsest = step;
  for (const auto& tile : scene.tiles()) {
    if (is_told_apart(tile->bounds, step, most)) continue;
    const Rounding rounding(*tile, step_m);
    for (std::size_t v = 0; v < tile->positions.size(); ++v) {
      if (!rounding.is_drawn(v)) continue;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        coarsest = std::max(coarsest, rounding.step_m(rounding.halvings(v, axis)));
      }
    }
  }
  return static_cast<float>(coarsest);
}

float one_step_for_all(float step_m, const base::Bounds& bounds) {
  constexpr int kMostSteps = 1 << 21;
  auto step = static_cast<double>(step_m);
  double reach = 0;
  for (const auto member : {&base::Vec3f::x, &base::Vec3f::y, &base::Vec3f::z}) {
    const auto low = static_cast<double>(bounds.min.*member);
    const auto high = static_cast<double>(bounds.max.*member);
    reach = std::max({reach, std::abs(low), std::abs(high), high - low});
  }
  while (std::isfinite(reach) && reach >= step * (kMostSteps - 2)) step *= 2;
  return lattice_step(step);
}

protocol::Result<TileLattice> tile_lattice(const map::Tile& tile, float step_m) {
  TileLattice lattice;
  lattice.step_m = step_m;
  lattice.coarsest_step_m = step_m;
  const std::size_t count = tile.positions.size();
  lattice.points.resize(count);
  const Rounding rounding(tile, step_m);
  std::optional<int> fewest, most;
  for (std::size_t v = 0; v < count; ++v) {
    if (!rounding.is_drawn(v)) continue;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float coordinate = rounding.coordinates(v)[axis];
      if (!std::isfinite(coordinate)) {
        return protocol::refusal(protocol::RpcErrorCode::InternalError,
                                 "vertex " + std::to_string(v) + " has a coordinate that is not finite");
      }
      const int halvings = rounding.halvings(v, axis);
      fewest = std::min(fewest.value_or(halvings), halvings);
      most = std::max(most.value_or(halvings), halvings);
    }
  }
  if (!most) return lattice;
  const double finest_m = rounding.step_m(*most);
  std::vector<std::array<double, 3>> rounded(count);
  std::array<double, 3> lowest{};
  lowest.fill(std::numeric_limits<double>::infinity());
  for (std::size_t v = 0; v < count; ++v) {
    if (!rounding.is_drawn(v)) continue;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const int halvings = rounding.halvings(v, axis);
      const double step = rounding.step_m(halvings);
      // In finest steps, exact.
      rounded[v][axis] =
          std::ldexp(std::floor(static_cast<double>(rounding.coordinates(v)[axis]) / step + 0.5), *most - halvings);
      lowest[axis] = std::min(lowest[axis], rounded[v][axis]);
    }
  }
  for (std::size_t v = 0; v < count; ++v) {
    if (!rounding.is_drawn(v)) continue;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      constexpr double kMostSteps = std::numeric_limits<std::int32_t>::max();
      const double steps = rounded[v][axis] - lowest[axis];
      if (!(steps <= kMostSteps)) {
        return protocol::refusal(protocol::RpcErrorCode::InternalError,
                                 "vertex " + std::to_string(v) + " is too far from the others for the position step");
      }
      lattice.points[v][axis] = static_cast<std::int32_t>(steps);
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis) lattice.origin_m[axis] = static_cast<float>(lowest[axis] * finest_m);
  lattice.step_m = static_cast<float>(finest_m);
  lattice.coarsest_step_m = static_cast<float>(rounding.step_m(*fewest));
  return lattice;
}

}  // namespace spectra::stream
