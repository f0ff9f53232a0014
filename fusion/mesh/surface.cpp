#include "fusion/mesh/surface.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "fusion/base/box.hpp"
#include "fusion/base/vector.hpp"

namespace spectra::mesh {
namespace {

using base::Triangle;
using base::Vec3f;

using Vector = base::Vec3d;

double squared_distance_to_segment(const base::Vec3f& p, const base::Vec3f& a, const base::Vec3f& b) {
  const Vector ab = b - a, ap = p - a;
  const double length = dot(ab, ab);
  const double s = length > 0 ? std::clamp(dot(ap, ab) / length, 0.0, 1.0) : 0;
  const Vector rest{ap.x - s * ab.x, ap.y - s * ab.y, ap.z - s * ab.z};
  return dot(rest, rest);
}

/// Of a sample, to a few percent.
double mean_edge_length(const Surface& surface) {
  const std::size_t stride = surface.triangles().size() / 4096 + 1;
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < surface.triangles().size(); i += stride) {
    const base::Triangle& t = surface.triangles()[i];
    for (unsigned corner = 0; corner < 3; ++corner) {
      sum += std::sqrt(squared_distance(surface.positions()[t[corner]], surface.positions()[t[(corner + 1) % 3]]));
      ++count;
    }
  }
  return count > 0 ? sum / count : 0;
}

/// Calls back with points of a triangle that is longer than `spacing`: its centroid, its edges cut to that length (but not to
/// more than 16 pieces), and points as dense inside; never its corners.
template <class Callback>
void sample(const base::Vec3f& a, const base::Vec3f& b, const base::Vec3f& c, double spacing, Callback callback) {
  const auto at = [&](double u, double v, double w) {
    const auto mix = [&](float from_a, float from_b, float from_c) {
      return static_cast<float>(u * static_cast<double>(from_a) + v * static_cast<double>(from_b) +
                                w * static_cast<double>(from_c));
    };
    return base::Vec3f{mix(a.x, b.x, c.x), mix(a.y, b.y, c.y), mix(a.z, b.z, c.z)};
  };
  callback(at(1.0 / 3, 1.0 / 3, 1.0 / 3));
  const double longest = std::sqrt(std::max({squared_distance(a, b), squared_distance(b, c), squared_distance(c, a)}));
  const int pieces = longest < 16 * spacing ? static_cast<int>(longest / spacing) + 1 : 16;
  for (int i = 0; i <= pieces; ++i) {
    for (int j = 0; i + j <= pieces; ++j) {
      const int k = pieces - i - j;
      if (std::max({i, j, k}) < pieces) callback(at(1.0 * i / pieces, 1.0 * j / pieces, 1.0 * k / pieces));
    }
  }
}

/// The largest distance seen; looks closer only at points that would raise it.
class LargestDistance {
 public:
  /// Of those that are larger than `seen_squared`.
  explicit LargestDistance(const Surface& surface, double seen_squared = 0)
      : surface_(surface), largest_squared_(seen_squared) {}

  void add(const base::Vec3f& p, std::span<const std::uint32_t> starts) {
    double squared = std::numeric_limits<double>::infinity();
    for (const std::uint32_t start : starts) {
      squared = std::min(squared, surface_.squared_distance_near(p, start, largest_squared_));
      if (squared <= largest_squared_) return;
    }
    // Where the walk got stuck its bound is too large; few points set a record, and those may cost more.
    if (exact_count_ < kMostExact) {
      ++exact_count_;
      squared = surface_.squared_distance_anywhere(p, largest_squared_, squared);
    }
    largest_squared_ = std::max(largest_squared_, squared);
  }

  double squared() const { return largest_squared_; }

 private:
  static constexpr int kMostExact = 1000;

  const Surface& surface_;
  double largest_squared_;
  int exact_count_ = 0;
};

}  // namespace

double squared_distance(const base::Vec3f& a, const base::Vec3f& b) {
  const Vector d = a - b;
  return dot(d, d);
}

double squared_distance_to_box(const base::Vec3f& p, const base::Bounds& box) {
  return squared_distance(p, base::Vec3f{std::clamp(p.x, box.min.x, box.max.x), std::clamp(p.y, box.min.y, box.max.y),
                                         std::clamp(p.z, box.min.z, box.max.z)});
}

double squared_distance_to_triangle(const base::Vec3f& p, const base::Vec3f& a, const base::Vec3f& b,
                                    const base::Vec3f& c) {
  const Vector ab = b - a, ac = c - a, ap = p - a;
  const Vector normal = cross(ab, ac);
  const double area = dot(normal, normal);
  if (area > 0) {
    const double of_c = dot(cross(ab, ap), normal);
    const double of_b = dot(cross(ap, ac), normal);
    const double of_a = area - of_b - of_c;
    if (of_a >= 0 && of_b >= 0 && of_c >= 0) {
      const double height = dot(ap, normal);
      return height * height / area;
    }
    // What is nearest lies on an edge that has the point on its outer side.
    double best = std::numeric_limits<double>::infinity();
    if (of_a < 0) best = squared_distance_to_segment(p, b, c);
    if (of_b < 0) best = std::min(best, squared_distance_to_segment(p, c, a));
    if (of_c < 0) best = std::min(best, squared_distance_to_segment(p, a, b));
    return best;
  }
  return std::min({squared_distance_to_segment(p, a, b), squared_distance_to_segment(p, b, c),
                   squared_distance_to_segment(p, c, a)});
}

double triangle_area(const base::Vec3f& a, const base::Vec3f& b, const base::Vec3f& c) {
  const Vector n = cross(b - a, c - a);
  return std::sqrt(dot(n, n)) / 2;
}

std::array<double, 3> nearest_weights(const base::Vec3f& p, const base::Vec3f& a, const base::Vec3f& b,
                                      const base::Vec3f& c) {
  const Vector ab = b - a, ac = c - a, ap = p - a;
  const Vector normal = cross(ab, ac);
  const double area = dot(normal, normal);
  if (area > 0) {
    const double of_c = dot(cross(ab, ap), normal) / area;
    const double of_b = dot(cross(ap, ac), normal) / area;
    if (of_b >= 0 && of_c >= 0 && of_b + of_c <= 1) return {1 - of_b - of_c, of_b, of_c};
  }
  std::array<double, 3> best{1, 0, 0};
  double best_squared = std::numeric_limits<double>::infinity();
  const std::array corners{a, b, c};
  for (unsigned i = 0; i < 3; ++i) {
    const unsigned j = (i + 1) % 3;
    const Vector along = corners[j] - corners[i], to = p - corners[i];
    const double length = dot(along, along);
    const double s = length > 0 ? std::clamp(dot(to, along) / length, 0.0, 1.0) : 0;
    const Vector rest{to.x - s * along.x, to.y - s * along.y, to.z - s * along.z};
    if (dot(rest, rest) >= best_squared) continue;
    best_squared = dot(rest, rest);
    best = {};
    best[i] = 1 - s;
    best[j] = s;
  }
  return best;
}

Surface::Surface(std::span<const base::Vec3f> positions, std::span<const base::Triangle> triangles)
    : positions_(positions), triangles_(triangles), offsets_(positions.size() + 1), around_(3 * triangles.size()) {
  for (const base::Triangle& triangle : triangles) {
    for (const std::uint32_t v : triangle) ++offsets_[v];
  }
  std::uint32_t sum = 0;
  for (std::uint32_t& offset : offsets_) offset = sum += offset;
  // Filled from behind, each offset walks down to the beginning of its range.
  for (std::size_t t = triangles.size(); t-- > 0;) {
    for (const std::uint32_t v : triangles[t]) around_[--offsets_[v]] = static_cast<std::uint32_t>(t);
  }
  block_bounds_.reserve(triangles.size() / kBlockSize + 1);
  std::vector<base::Vec3f> corners;
  for (std::size_t begin = 0; begin < triangles.size(); begin += kBlockSize) {
    corners.clear();
    for (const base::Triangle& t : triangles.subspan(begin, std::min(kBlockSize, triangles.size() - begin))) {
      for (const std::uint32_t v : t) corners.push_back(positions[v]);
    }
    block_bounds_.push_back(base::bounds_of(corners));
  }
}

std::uint32_t Surface::nearest_vertex_near(const base::Vec3f& p, std::uint32_t start, double enough) const {
  constexpr int kMostSteps = 24;
  double nearest = squared_distance(p, positions_[start]);
  for (int step = 0; step < kMostSteps && nearest > enough; ++step) {
    const std::uint32_t from = start;
    const auto around = triangles_around(from);
    for (const std::uint32_t t : around.first(std::min(around.size(), kMostTriangles))) {
      for (const std::uint32_t v : triangles_[t]) {
        const double squared = squared_distance(p, positions_[v]);
        if (squared < nearest) {
          nearest = squared;
          start = v;
        }
      }
    }
    if (start == from) break;
  }
  return start;
}

double Surface::squared_distance_near(const base::Vec3f& p, std::uint32_t start, double enough) const {
  return triangle_near(p, start, enough).squared_distance;
}

NearTriangle Surface::triangle_near(const base::Vec3f& p, std::uint32_t start, double enough) const {
  constexpr std::size_t kMostSteps = 12;
  std::array<std::uint32_t, kMostSteps> visited{};
  double best = std::numeric_limits<double>::infinity();
  std::uint32_t best_triangle = kNone;
  std::uint32_t vertex = nearest_vertex_near(p, start, enough);
  for (std::size_t step = 0; step < kMostSteps; ++step) {
    visited[step] = vertex;
    const double before = best;
    const auto around = triangles_around(vertex);
    for (const std::uint32_t t : around.first(std::min(around.size(), kMostTriangles))) {
      const base::Triangle& triangle = triangles_[t];
      const double squared =
          squared_distance_to_triangle(p, positions_[triangle[0]], positions_[triangle[1]], positions_[triangle[2]]);
      if (squared < best) {
        best = squared;
        best_triangle = t;
        if (best <= enough) return {best_triangle, best};
      }
    }
    if (!(best < before)) break;
    double nearest = std::numeric_limits<double>::infinity();
    for (const std::uint32_t v : triangles_[best_triangle]) {
      const double squared = squared_distance(p, positions_[v]);
      const auto end = visited.begin() + static_cast<std::ptrdiff_t>(step) + 1;
      if (squared < nearest && std::find(visited.begin(), end, v) == end) {
        nearest = squared;
        vertex = v;
      }
    }
    if (std::isinf(nearest)) break;
  }
  return {best_triangle, best};
}

double Surface::squared_distance_anywhere(const base::Vec3f& p, double enough, double at_most) const {
  double best = at_most;
  for (std::size_t block = 0; block < block_bounds_.size() && best > enough; ++block) {
    if (squared_distance_to_box(p, block_bounds_[block]) >= best) continue;
    const std::size_t begin = block * kBlockSize;
    for (const base::Triangle& t : triangles_.subspan(begin, std::min(kBlockSize, triangles_.size() - begin))) {
      best = std::min(best, squared_distance_to_triangle(p, positions_[t[0]], positions_[t[1]], positions_[t[2]]));
    }
  }
  return best;
}

std::vector<std::uint32_t> Surface::nearest_seeds(const std::vector<bool>& is_seed) const {
  std::vector<std::uint32_t> seed_of(positions_.size(), kNone);
  std::vector<std::uint32_t> edges_away(positions_.size(), 0);
  std::vector<std::uint32_t> queue;
  queue.reserve(positions_.size());
  for (std::uint32_t v = 0; v < positions_.size(); ++v) {
    if (!is_seed[v]) continue;
    seed_of[v] = v;
    queue.push_back(v);
  }
  for (std::size_t next = 0; next < queue.size(); ++next) {
    const std::uint32_t v = queue[next];
    for (const std::uint32_t t : triangles_around(v)) {
      for (const std::uint32_t w : triangles_[t]) {
        if (seed_of[w] == kNone) {
          seed_of[w] = seed_of[v];
          edges_away[w] = edges_away[v] + 1;
          queue.push_back(w);
        } else if (edges_away[w] == edges_away[v] + 1 && seed_of[w] != seed_of[v] &&
                   squared_distance(positions_[w], positions_[seed_of[v]]) <
                       squared_distance(positions_[w], positions_[seed_of[w]])) {
          seed_of[w] = seed_of[v];
        }
      }
    }
  }
  return seed_of;
}

std::vector<bool> Surface::open_vertices() const {
  std::vector<bool> is_open(positions_.size());
  std::vector<std::pair<std::uint32_t, int>> edges;
  for (std::uint32_t v = 0; v < positions_.size(); ++v) {
    edges.clear();
    for (const std::uint32_t t : triangles_around(v)) {
      const base::Triangle& triangle = triangles_[t];
      const unsigned corner = triangle[0] == v ? 0 : triangle[1] == v ? 1 : 2;
      edges.emplace_back(triangle[(corner + 1) % 3], 1);
      edges.emplace_back(triangle[(corner + 2) % 3], -1);
    }
    std::sort(edges.begin(), edges.end());
    for (std::size_t i = 0; i < edges.size();) {
      const std::uint32_t other = edges[i].first;
      int balance = 0;
      for (; i < edges.size() && edges[i].first == other; ++i) balance += edges[i].second;
      if (balance != 0) is_open[v] = is_open[other] = true;
    }
  }
  return is_open;
}

double two_sided_distance(const Surface& fine, const Surface& coarse, std::span<const std::uint32_t> coarse_of_fine,
                          std::span<const std::uint32_t> fine_of_coarse) {
  const double spacing = 1.5 * mean_edge_length(fine);
  LargestDistance from_coarse(coarse);
  for (std::size_t v = 0; v < fine.positions().size(); ++v) {
    if (fine_of_coarse[coarse_of_fine[v]] != v) from_coarse.add(fine.positions()[v], {&coarse_of_fine[v], 1});
  }
  const auto add_samples = [&](const Surface& of, LargestDistance& from, std::span<const std::uint32_t> start_of) {
    for (const base::Triangle& t : of.triangles()) {
      const std::array starts{start_of[t[0]], start_of[t[1]], start_of[t[2]]};
      sample(of.positions()[t[0]], of.positions()[t[1]], of.positions()[t[2]], spacing,
             [&](const base::Vec3f& p) { from.add(p, starts); });
    }
  };
  add_samples(fine, from_coarse, coarse_of_fine);
  LargestDistance either(fine, from_coarse.squared());
  add_samples(coarse, either, fine_of_coarse);
  return std::sqrt(either.squared());
}

}  // namespace spectra::mesh
