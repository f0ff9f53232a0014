#include "server/map/block_baseline.hpp"

#include <algorithm>
#include <boost/geometry.hpp>
#include <boost/geometry/geometries/point.hpp>
#include <boost/geometry/index/rtree.hpp>
#include <cmath>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>

#include "fusion/mesh/surface.hpp"

namespace spectra::map {
namespace {

namespace bg = boost::geometry;
namespace bgi = boost::geometry::index;
using base::Vec3f;
using Point = bg::model::point<double, 3, bg::cs::cartesian>;
using Entry = std::pair<Point, std::uint32_t>;

Point point_of(const base::Vec3f& p) {
  return {double{p.x}, double{p.y}, double{p.z}};
}

class NearestBefore {
 public:
  NearestBefore(const ReplacedVertices& before, double reach_m) : before_(before), reach_m_(reach_m) {
    // Of several in one place the first: however many there are, they cost nothing later.
    std::vector<std::uint32_t> order(before.positions.size());
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      const base::Vec3f &p = before.positions[a], &q = before.positions[b];
      return std::tie(p.x, p.y, p.z, before.source[a]) < std::tie(q.x, q.y, q.z, before.source[b]);
    });
    std::vector<Entry> entries;
    for (std::size_t i = 0; i < order.size(); ++i) {
      const base::Vec3f& p = before.positions[order[i]];
      if (i == 0 || !(p == before.positions[order[i - 1]])) entries.emplace_back(point_of(p), order[i]);
    }
    tree_ = Tree(entries);
  }

  std::optional<std::uint32_t> operator()(const base::Vec3f& p) const {
    std::optional<std::uint32_t> best;
    double best_squared = reach_m_ * reach_m_;
    for (auto found = tree_.qbegin(bgi::nearest(point_of(p), static_cast<unsigned>(tree_.size())));
         found != tree_.qend(); ++found) {
      const std::uint32_t v = found->second;
      const double squared = mesh::squared_distance(p, before_.positions[v]);
      // The next ones are no nearer, but for rounding.
      if (squared > best_squared * (1 + 1e-12)) break;
      if (squared > best_squared) continue;
      if (squared == best_squared && best && before_.source[v] > before_.source[*best]) continue;
      best = v;
      best_squared = squared;
    }
    return best;
  }

 private:
  using Tree = bgi::rtree<Entry, bgi::linear<16>>;

  const ReplacedVertices& before_;
  const double reach_m_;
  Tree tree_;
};

bool is_same(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

}  // namespace

BlockBaseline handed_on(const ReplacedVertices& before, std::span<const base::Vec3f> positions,
                        std::span<const float> temperature_celsius, double observed_at, double reach_m) {
  BlockBaseline baseline{{temperature_celsius.begin(), temperature_celsius.end()},
                         std::vector<double>(positions.size(), observed_at)};
  const NearestBefore nearest(before, reach_m);
  bool is_any_other = false;
  for (std::size_t v = 0; v < positions.size(); ++v) {
    const auto found = nearest(positions[v]);
    if (!found || std::isnan(before.baseline.celsius[*found])) continue;
    baseline.celsius[v] = before.baseline.celsius[*found];
    baseline.at[v] = before.baseline.at[*found];
    is_any_other = is_any_other || !is_same(double{baseline.celsius[v]}, double{temperature_celsius[v]}) ||
                   !is_same(baseline.at[v], observed_at);
  }
  return is_any_other ? baseline : BlockBaseline{};
}

}  // namespace spectra::map
