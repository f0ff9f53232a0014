#include "fusion/mesh/simplify.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <queue>
#include <utility>

#include "fusion/base/box.hpp"
#include "fusion/base/vector.hpp"
#include "fusion/mesh/heat_spots.hpp"

namespace spectra::mesh {
namespace {

using base::Rgb8;
using base::Triangle;
using base::Vec3f;

constexpr std::uint32_t kNone = Surface::kNone;
constexpr std::size_t kAttributes = 4;  // red, green, blue, temperature
constexpr std::size_t kTemperature = 3;

/// Full contrast weighs as much as a shift by that part of the mean distance of the vertices that are left: half as much and colours get
/// worse by a tenth, twice as much and the form does.
constexpr double kSeenWeight = 0.5;
/// A spot that stands out by that part of the span is never given up for what stands out less.
constexpr double kSpotContrast = 1.0 / 16;
/// Spots whose apex is kept, of all vertices that are.
constexpr double kMostSpots = 1.0 / 8;
/// Against slivers where nothing else decides: of the length of an edge.
constexpr double kLengthWeight = 1e-4;
/// Triangles around a vertex into which others may be drawn: a hub of thousands would cost squares.
constexpr std::size_t kMostAround = 128;

using Vector = base::Vec3d;

/// A vertex as the quadrics see it: all in metres.
struct Sight {
  Vector position;
  std::array<double, kAttributes> attribute{};
  bool has_temperature = false;
};

/// A sum of squares, each of which has a weight: how far a point is from planes, and its attributes from linear fields. What is
/// quadratic in the position is gathered for all attributes at once.
struct Quadric {
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
  Vector linear;
  double constant = 0;
  std::array<double, kAttributes> gradient_x{}, gradient_y{}, gradient_z{}, offset{};
  double colour_weight = 0, temperature_weight = 0;
  double area = 0;

  /// The square of (n p + d), times `weight`.
  void add_plane(const Vector& n, double d, double weight) {
    xx += weight * n.x * n.x;
    xy += weight * n.x * n.y;
    xz += weight * n.x * n.z;
    yy += weight * n.y * n.y;
    yz += weight * n.y * n.z;
    zz += weight * n.z * n.z;
    linear = linear + n * (weight * d);
    constant += weight * d * d;
  }

  /// The square of (g p + d - attribute), times `weight`; the weights are counted by the caller.
  void add_field(std::size_t attribute, const Vector& g, double d, double weight) {
    add_plane(g, d, weight);
    gradient_x[attribute] += weight * g.x;
    gradient_y[attribute] += weight * g.y;
    gradient_z[attribute] += weight * g.z;
    offset[attribute] += weight * d;
  }

  void add(const Quadric& other) {
    xx += other.xx;
    xy += other.xy;
    xz += other.xz;
    yy += other.yy;
    yz += other.yz;
    zz += other.zz;
    linear = linear + other.linear;
    constant += other.constant;
    for (std::size_t j = 0; j < kAttributes; ++j) {
      gradient_x[j] += other.gradient_x[j];
      gradient_y[j] += other.gradient_y[j];
      gradient_z[j] += other.gradient_z[j];
      offset[j] += other.offset[j];
    }
    colour_weight += other.colour_weight;
    temperature_weight += other.temperature_weight;
    area += other.area;
  }

  double weight_of(std::size_t attribute) const {
    return attribute == kTemperature ? temperature_weight : colour_weight;
  }

  double at(const Sight& s) const {
    const Vector& p = s.position;
    double sum = constant + 2 * dot(linear, p) + xx * p.x * p.x + yy * p.y * p.y + zz * p.z * p.z +
                 2 * (xy * p.x * p.y + xz * p.x * p.z + yz * p.y * p.z);
    std::array<double, kAttributes> fields;
    for (std::size_t j = 0; j < kAttributes; ++j) fields[j] = field(j, p);
    for (std::size_t j = 0; j < kAttributes; ++j) {
      // Where the point has no temperature nothing is known of its difference: the fields' own best is taken.
      const double weight = weight_of(j);
      const double value = j != kTemperature || s.has_temperature ? s.attribute[j]
                           : weight > 0                           ? fields[j] / weight
                                                                  : 0;
      sum += value * (weight * value - 2 * fields[j]);
    }
    return sum;
  }

  /// The attribute that makes the sum least at a place.
  double best(std::size_t attribute, const Vector& p) const { return field(attribute, p) / weight_of(attribute); }

  /// What the fields say of an attribute at a place, times its weight.
  double field(std::size_t attribute, const Vector& p) const {
    return gradient_x[attribute] * p.x + gradient_y[attribute] * p.y + gradient_z[attribute] * p.z + offset[attribute];
  }
};

/// The range of what a vertex stands for.
struct Range {
  float low = std::numeric_limits<float>::infinity(), high = -std::numeric_limits<float>::infinity();

  void add(const Range& other) {
    low = std::min(low, other.low);
    high = std::max(high, other.high);
  }
};

}  // namespace

struct SimplifyArrays::State {
  std::vector<base::Triangle> triangles;
  std::vector<std::uint32_t> head, tail, next;
  std::vector<Sight> sights;
  std::vector<std::array<Range, 3>> colour_range;
  std::vector<Range> temperature_range;
  std::vector<Quadric> quadrics;
};

namespace {

class Simplifier {
 public:
  Simplifier(const SimplifyInput& input, std::size_t wanted_count, SimplifyArrays::State& arrays)
      : input_(input),
        wanted_count_(wanted_count),
        triangles_(arrays.triangles),
        is_alive_(input.surface.triangles().size(), true),
        head_(arrays.head),
        tail_(arrays.tail),
        next_(arrays.next),
        standing_(input.surface.positions().size()),
        marked_in_(standing_.size()),
        seen_in_(standing_.size()),
        sights_(arrays.sights),
        colour_range_(arrays.colour_range),
        temperature_range_(arrays.temperature_range),
        quadrics_(arrays.quadrics) {
    triangles_.assign(input.surface.triangles().begin(), input.surface.triangles().end());
    head_.assign(standing_.size(), kNone);
    tail_.assign(standing_.size(), kNone);
    next_.assign(3 * triangles_.size(), kNone);
    sights_.clear();
    colour_range_.clear();
    temperature_range_.clear();
    quadrics_.clear();
    std::iota(standing_.begin(), standing_.end(), 0u);
    for (std::uint32_t corner = 0; corner < next_.size(); ++corner) {
      link(triangles_[corner / 3][corner % 3], corner, corner);
    }
    live_count_ =
        static_cast<std::size_t>(std::count_if(head_.begin(), head_.end(), [](auto h) { return h != kNone; }));
  }

  Simplified run() {
    if (live_count_ > wanted_count_ && prepare()) collapse_cheapest();
    return result();
  }

 private:
  enum class Kind : std::uint8_t { Fixed, Border, Inner };

  struct Entry {
    double cost;
    std::uint32_t vertex;
    bool operator>(const Entry& other) const { return std::pair(cost, vertex) > std::pair(other.cost, other.vertex); }
  };

  void link(std::uint32_t vertex, std::uint32_t first, std::uint32_t last) {
    if (head_[vertex] == kNone) {
      head_[vertex] = first;
    } else {
      next_[tail_[vertex]] = first;
    }
    tail_[vertex] = last;
  }

  /// Calls back with each living triangle around a vertex, and forgets the others.
  template <class Callback>
  void around(std::uint32_t vertex, Callback callback) {
    std::uint32_t before = kNone;
    for (std::uint32_t corner = head_[vertex]; corner != kNone;) {
      const std::uint32_t after = next_[corner];
      if (is_alive_[corner / 3]) {
        callback(triangles_[corner / 3]);
        before = corner;
      } else {
        (before == kNone ? head_[vertex] : next_[before]) = after;
        if (after == kNone) tail_[vertex] = before;
      }
      corner = after;
    }
  }

  /// False where the scene is too large or too small for squares of squares.
  bool prepare() {
    const std::span<const base::Vec3f> positions = input_.surface.positions();
    const base::Bounds bounds = base::bounds_of(positions);
    const auto middle = [](float low, float high) {
      return (static_cast<double>(low) + static_cast<double>(high)) / 2;
    };
    const Vector centre{middle(bounds.min.x, bounds.max.x), middle(bounds.min.y, bounds.max.y),
                        middle(bounds.min.z, bounds.max.z)};
    const std::vector<double> areas = vertex_areas(input_.surface);
    const double area = std::accumulate(areas.begin(), areas.end(), 0.0);
    const double cell_area = area / static_cast<double>(wanted_count_);
    if (!(cell_area > 1e-60 && cell_area < 1e60)) return false;
    const double cell = std::sqrt(cell_area);
    celsius_in_metres_ = kSeenWeight * cell / input_.span_celsius;
    level_in_metres_ = kSeenWeight * cell / 255;

    float lowest = std::numeric_limits<float>::quiet_NaN(), highest = lowest;  // Of those that the sensor can tell.
    for (const float t : input_.temperature_celsius) {
      if (!std::isfinite(t)) continue;
      lowest = std::fmin(lowest, t);
      highest = std::fmax(highest, t);
    }
    celsius_.assign(input_.temperature_celsius.begin(), input_.temperature_celsius.end());
    sights_.resize(positions.size());
    colour_range_.resize(positions.size());
    temperature_range_.resize(positions.size());
    for (std::size_t v = 0; v < positions.size(); ++v) {
      Sight& s = sights_[v];
      const base::Vec3f& p = positions[v];
      s.position = Vector{static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)} - centre;
      const base::Rgb8 c = input_.visible[v];
      const std::array<std::uint8_t, 3> channels{c.r, c.g, c.b};
      for (std::size_t j = 0; j < 3; ++j) {
        s.attribute[j] = level_in_metres_ * channels[j];
        colour_range_[v][j] = {static_cast<float>(channels[j]), static_cast<float>(channels[j])};
      }
      float& t = celsius_[v];
      s.has_temperature = !std::isnan(t);
      if (!s.has_temperature) continue;
      const float shown = std::isinf(t) ? (t > 0 ? highest : lowest) : t;
      temperature_range_[v] = {shown, shown};
      // Beyond what the sensor can tell is farther out than anything that it tells.
      if (std::isinf(t)) t = shown + std::copysign(static_cast<float>(input_.span_celsius), t);
      if (std::isnan(t)) t = 0;  // Of a scene where all are beyond.
      s.attribute[kTemperature] = celsius_in_metres_ * static_cast<double>(t);
    }
    find_kinds();
    keep_spots(areas, cell_area);
    make_quadrics();
    return true;
  }

  void find_kinds() {
    kind_.assign(head_.size(), Kind::Fixed);
    std::vector<std::pair<std::uint32_t, int>> edges;
    for (std::uint32_t v = 0; v < head_.size(); ++v) {
      if (input_.is_locked[v] || head_[v] == kNone) continue;
      edges.clear();
      around(v, [&](const base::Triangle& t) {
        const unsigned corner = t[0] == v ? 0 : t[1] == v ? 1 : 2;
        edges.emplace_back(t[(corner + 1) % 3], 1);
        edges.emplace_back(t[(corner + 2) % 3], -1);
      });
      std::sort(edges.begin(), edges.end());
      std::size_t open_count = 0;
      bool is_simple = edges.size() <= 2 * kMostAround;
      for (std::size_t i = 0; i < edges.size() && is_simple;) {
        std::size_t end = i + 1;
        while (end < edges.size() && edges[end].first == edges[i].first) ++end;
        if (end - i == 1) ++open_count;
        is_simple = end - i == 1 || (end - i == 2 && edges[i].second != edges[i + 1].second);
        i = end;
      }
      if (is_simple && open_count == 0) kind_[v] = Kind::Inner;
      if (is_simple && open_count == 2) kind_[v] = Kind::Border;
    }
  }

  void keep_spots(const std::vector<double>& areas, double cell_area) {
    boost_.assign(triangles_.size(), 1.0f);
    std::vector<HeatSpot> spots =
        heat_spots(input_.surface, celsius_, areas, kSpotContrast * input_.span_celsius, cell_area);
    for (const HeatSpot& spot : spots) {
      const auto boost = static_cast<float>(std::min(cell_area / std::max(spot.area_m2, 1e-6 * cell_area), 1e6));
      for (const std::uint32_t v : spot.members) {
        for (const std::uint32_t t : input_.surface.triangles_around(v)) boost_[t] = std::max(boost_[t], boost);
      }
    }
    const auto most = static_cast<std::size_t>(kMostSpots * static_cast<double>(wanted_count_)) + 1;
    if (spots.size() > most) {
      // Those first that differ most from what lies around them.
      std::vector<std::pair<double, std::uint32_t>> order;
      for (const HeatSpot& spot : spots) order.emplace_back(-drop(spot), spot.apex);
      std::nth_element(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(most), order.end());
      order.resize(most);
      for (const auto& [_, apex] : order) keep_apex(apex);
    } else {
      for (const HeatSpot& spot : spots) keep_apex(spot.apex);
    }
  }

  void keep_apex(std::uint32_t v) {
    kind_[v] = Kind::Fixed;
    apexes_.push_back(v);
  }

  double drop(const HeatSpot& spot) const {
    double largest = 0;
    const double apex = sights_[spot.apex].attribute[kTemperature];
    for (const std::uint32_t v : spot.members) {
      for (const std::uint32_t t : input_.surface.triangles_around(v)) {
        for (const std::uint32_t w : input_.surface.triangles()[t]) {
          if (sights_[w].has_temperature)
            largest = std::max(largest, std::fabs(apex - sights_[w].attribute[kTemperature]));
        }
      }
    }
    return largest;
  }

  void make_quadrics() {
    quadrics_.resize(head_.size());
    for (std::size_t i = 0; i < triangles_.size(); ++i) {
      const base::Triangle& t = triangles_[i];
      const std::array<const Sight*, 3> s{&sights_[t[0]], &sights_[t[1]], &sights_[t[2]]};
      const Vector e1 = s[1]->position - s[0]->position, e2 = s[2]->position - s[0]->position;
      const Vector e3 = s[2]->position - s[1]->position;
      const Vector n = cross(e1, e2);
      const double squared = dot(n, n);
      if (!(squared > 0)) continue;
      const double doubled_area = std::sqrt(squared);
      const double area = doubled_area / 2;
      Quadric q;
      q.area = area;
      const Vector unit = n * (1 / doubled_area);
      q.add_plane(unit, -dot(unit, s[0]->position), area);
      // A needle spreads what it shows beyond all reason.
      const double shape = std::min(1.0, 3.46 * doubled_area / (dot(e1, e1) + dot(e2, e2) + dot(e3, e3)));
      const double weight = area * shape;
      const Vector along1 = cross(e2, n) * (1 / squared), along2 = cross(n, e1) * (1 / squared);
      const auto field = [&](std::size_t j, double field_weight) {
        const double a0 = s[0]->attribute[j];
        const Vector g = along1 * (s[1]->attribute[j] - a0) + along2 * (s[2]->attribute[j] - a0);
        q.add_field(j, g, a0 - dot(g, s[0]->position), field_weight);
      };
      for (std::size_t j = 0; j < kTemperature; ++j) field(j, weight);
      q.colour_weight = weight;
      if (s[0]->has_temperature && s[1]->has_temperature && s[2]->has_temperature) {
        q.temperature_weight = weight * static_cast<double>(boost_[i]);
        field(kTemperature, q.temperature_weight);
      }
      for (const std::uint32_t v : t) quadrics_[v].add(q);
      for (unsigned corner = 0; corner < 3; ++corner) add_border(t[corner], t[(corner + 1) % 3], unit);
    }
  }

  /// Open edges hold their line.
  void add_border(std::uint32_t a, std::uint32_t b, const Vector& normal) {
    if (kind_[a] == Kind::Inner || kind_[b] == Kind::Inner || shared_count(a, b) != 1) return;
    const Vector edge = sights_[b].position - sights_[a].position;
    const Vector outward = cross(edge, normal);
    const double length = std::sqrt(dot(outward, outward));
    if (!(length > 0)) return;
    Quadric q;
    const Vector unit = outward * (1 / length);
    q.add_plane(unit, -dot(unit, sights_[a].position), dot(edge, edge));
    quadrics_[a].add(q);
    quadrics_[b].add(q);
  }

  std::size_t shared_count(std::uint32_t a, std::uint32_t b) {
    std::size_t count = 0;
    around(a, [&](const base::Triangle& t) {
      if (t[0] == b || t[1] == b || t[2] == b) ++count;
    });
    return count;
  }

  double cost(std::uint32_t from, std::uint32_t to) const {
    const Quadric& q = quadrics_[from];
    const Sight &a = sights_[from], &b = sights_[to];
    const Vector edge = b.position - a.position;
    double sum = std::max(0.0, q.at(b)) + kLengthWeight * q.area * dot(edge, edge);
    if (a.has_temperature != b.has_temperature) {
      // As bad as half a contrast: what is missing must not spread, nor be filled.
      const double half = 0.5 * celsius_in_metres_ * input_.span_celsius;
      sum += q.area * half * half;
    }
    return sum;
  }

  /// Whether the surface stays one: no new place where sheets meet, no triangle turned over.
  bool may_collapse(std::uint32_t from, std::uint32_t to) {
    ++mark_;
    std::size_t shared = 0, common = 0, count = 0, others = 0;
    std::uint32_t apex = kNone;
    bool is_turned = false;
    const Vector& target = sights_[to].position;
    around(from, [&](const base::Triangle& t) {
      const unsigned corner = t[0] == from ? 0 : t[1] == from ? 1 : 2;
      const std::uint32_t b = t[(corner + 1) % 3], c = t[(corner + 2) % 3];
      marked_in_[b] = marked_in_[c] = mark_;
      if (b == to || c == to) {
        ++shared;
        apex = b == to ? c : b;
        return;
      }
      ++others;
      const Vector &pb = sights_[b].position, &pc = sights_[c].position;
      const Vector edge = pc - pb;
      const Vector before = cross(edge, sights_[from].position - pb), after = cross(edge, target - pb);
      const double cosine = dot(before, after);
      const double squares = dot(before, before) * dot(after, after);
      if (cosine < 0 || cosine * cosine < 0.04 * squares) is_turned = true;
      if (!(dot(after, after) > 0)) is_turned = true;
    });
    if (is_turned || shared != (kind_[from] == Kind::Inner ? 2u : 1u)) return false;
    marked_in_[to] = 0;
    around(to, [&](const base::Triangle& t) {
      ++count;
      for (const std::uint32_t v : t) {
        if (marked_in_[v] != mark_) continue;
        marked_in_[v] = 0;
        if (v != from) ++common;
      }
    });
    if (common != shared || count > kMostAround) return false;
    // A triangle without neighbours stays: it is all that is there.
    return shared != 1 || others > 0 || shared_count(to, apex) > 1;
  }

  /// The neighbour into which a vertex is best drawn, of those into which it may be; kNone when there is none.
  Entry best_target(std::uint32_t from) {
    neighbours_.clear();
    ++seen_mark_;
    around(from, [&](const base::Triangle& t) {
      for (const std::uint32_t v : t) {
        if (v == from || seen_in_[v] == seen_mark_) continue;
        seen_in_[v] = seen_mark_;
        neighbours_.push_back({cost(from, v), v});
      }
    });
    // The first that is cheap mostly may.
    while (!neighbours_.empty()) {
      const auto cheapest = std::min_element(neighbours_.begin(), neighbours_.end(),
                                             [](const Entry& a, const Entry& b) { return b > a; });
      if (may_collapse(from, cheapest->vertex)) return *cheapest;
      *cheapest = neighbours_.back();
      neighbours_.pop_back();
    }
    return {0, kNone};
  }

  void collapse_cheapest() {
    target_.assign(head_.size(), kNone);
    std::vector<bool> is_outdated(head_.size());
    std::vector<Entry> first;
    first.reserve(live_count_);
    for (std::uint32_t v = 0; v < head_.size(); ++v) {
      if (kind_[v] == Kind::Fixed || head_[v] == kNone) continue;
      const Entry best = best_target(v);
      target_[v] = best.vertex;
      if (best.vertex != kNone) first.push_back({best.cost, v});
    }
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue(std::greater<>(), std::move(first));
    std::vector<std::uint32_t> ring;
    while (live_count_ > wanted_count_ && !queue.empty()) {
      const Entry top = queue.top();
      queue.pop();
      const std::uint32_t from = top.vertex;
      std::uint32_t to = target_[from];
      if (is_outdated[from] || standing_[to] != to || !may_collapse(from, to)) {
        is_outdated[from] = false;
        const Entry best = best_target(from);
        to = target_[from] = best.vertex;
        if (to != kNone) queue.push({best.cost, from});
        continue;
      }
      ring.clear();
      around(from, [&](const base::Triangle& t) { ring.insert(ring.end(), t.begin(), t.end()); });
      collapse(from, to);
      is_outdated[to] = true;
      // What could not be drawn anywhere may be now.
      for (const std::uint32_t v : ring) {
        if (v == from || target_[v] != kNone || kind_[v] == Kind::Fixed) continue;
        const Entry best = best_target(v);
        target_[v] = best.vertex;
        if (best.vertex != kNone) queue.push({best.cost, v});
      }
    }
  }

  void collapse(std::uint32_t from, std::uint32_t to) {
    std::uint32_t first = kNone, last = kNone;
    for (std::uint32_t corner = head_[from]; corner != kNone;) {
      const std::uint32_t after = next_[corner];
      base::Triangle& t = triangles_[corner / 3];
      if (is_alive_[corner / 3]) {
        if (t[0] == to || t[1] == to || t[2] == to) {
          is_alive_[corner / 3] = false;
        } else {
          t[corner % 3] = to;
          (first == kNone ? first : next_[last]) = corner;
          last = corner;
        }
      }
      corner = after;
    }
    if (last != kNone) {
      next_[last] = kNone;
      link(to, first, last);
    }
    head_[from] = tail_[from] = kNone;
    quadrics_[to].add(quadrics_[from]);
    for (std::size_t j = 0; j < 3; ++j) colour_range_[to][j].add(colour_range_[from][j]);
    temperature_range_[to].add(temperature_range_[from]);
    standing_[from] = to;
    --live_count_;
  }

  Simplified result() {
    Simplified out;
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      if (is_alive_[t]) out.triangles.push_back(triangles_[t]);
    }
    out.visible.assign(input_.visible.begin(), input_.visible.end());
    out.temperature_celsius.assign(input_.temperature_celsius.begin(), input_.temperature_celsius.end());
    if (quadrics_.empty()) return out;
    for (const std::uint32_t v : apexes_) temperature_range_[v] = {celsius_[v], celsius_[v]};
    for (std::uint32_t v = 0; v < standing_.size(); ++v) {
      if (standing_[v] == v && head_[v] != kNone && !input_.is_locked[v]) fit(v, out);
    }
    return out;
  }

  void fit(std::uint32_t v, Simplified& out) const {
    const Quadric& q = quadrics_[v];
    const Vector& p = sights_[v].position;
    if (q.colour_weight > 0) {
      const auto channel = [&](std::size_t j) {
        const Range& range = colour_range_[v][j];
        const double level = std::clamp(q.best(j, p) / level_in_metres_, double{range.low}, double{range.high});
        return static_cast<std::uint8_t>(std::lround(level));
      };
      out.visible[v] = {channel(0), channel(1), channel(2)};
    }
    const Range& range = temperature_range_[v];
    if (!(range.low <= range.high) || std::isinf(input_.temperature_celsius[v])) return;
    if (q.temperature_weight > 0) {
      const double celsius = q.best(kTemperature, p) / celsius_in_metres_;
      out.temperature_celsius[v] = static_cast<float>(std::clamp(celsius, double{range.low}, double{range.high}));
    } else if (!sights_[v].has_temperature) {
      out.temperature_celsius[v] = range.low + (range.high - range.low) / 2;
    }
  }

  const SimplifyInput& input_;
  std::size_t wanted_count_;
  std::size_t live_count_ = 0;
  double celsius_in_metres_ = 0, level_in_metres_ = 0;
  std::vector<base::Triangle>& triangles_;
  std::vector<bool> is_alive_;
  std::vector<std::uint32_t>&head_, &tail_, &next_;  ///< Corners of triangles around each vertex.
  std::vector<std::uint32_t> standing_;  ///< For each vertex the one into which it has been drawn, or itself.
  std::vector<std::uint32_t> marked_in_, seen_in_;
  std::uint32_t mark_ = 0, seen_mark_ = 0;
  std::vector<Kind> kind_;
  std::vector<Sight>& sights_;
  std::vector<float> celsius_;  ///< Of each vertex; a span outside of all others where it is infinite.
  std::vector<std::array<Range, 3>>& colour_range_;
  std::vector<Range>& temperature_range_;
  std::vector<float> boost_;  ///< Per triangle: how many times its area its temperature counts.
  std::vector<std::uint32_t> apexes_;
  std::vector<Quadric>& quadrics_;
  std::vector<std::uint32_t> target_;
  std::vector<Entry> neighbours_;
};

}  // namespace

SimplifyArrays::SimplifyArrays() : state_(std::make_unique<State>()) {}
SimplifyArrays::~SimplifyArrays() = default;
SimplifyArrays::SimplifyArrays(SimplifyArrays&&) noexcept = default;
SimplifyArrays& SimplifyArrays::operator=(SimplifyArrays&&) noexcept = default;

SimplifyArrays SimplifyMemory::take() {
  const std::lock_guard lock(mutex_);
  if (free_.empty()) return {};
  SimplifyArrays arrays = std::move(free_.back());
  free_.pop_back();
  return arrays;
}

void SimplifyMemory::give_back(SimplifyArrays arrays) {
  const std::lock_guard lock(mutex_);
  free_.push_back(std::move(arrays));
}

void SimplifyMemory::clear() {
  const std::lock_guard lock(mutex_);
  free_.clear();
}

Simplified simplified(const SimplifyInput& input, std::size_t wanted_count, SimplifyMemory& memory) {
  SimplifyArrays arrays = memory.take();
  Simplified result = Simplifier(input, wanted_count, arrays.state()).run();
  memory.give_back(std::move(arrays));
  return result;
}

}  // namespace spectra::mesh
