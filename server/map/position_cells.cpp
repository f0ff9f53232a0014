#include <algorithm>
#include <limits>
#include <tuple>
#include <utility>

#include "server/map/position_shapes.hpp"
#include "server/map/position_step.hpp"

namespace spectra::map {

using namespace steps;

namespace {

/// Half as many to so many vertices are a cell: no more than the smallest patch that is to keep its form.
constexpr std::uint32_t kCellVertexCount = 44;

/// Parts of the tree that are made independently of each other.
constexpr std::uint32_t kBranchVertexCount = 1 << 16;

/// Where coincident vertices are sought: everything in the same place is together by then.
constexpr std::uint32_t kWeldVertexCount = 512;

}  // namespace

/// A part of the tree while it is made.
struct PositionSteps::Branch {
  std::uint32_t begin = 0, end = 0;
  std::uint32_t place = 0;  ///< Its first node in the whole tree.
  std::vector<Node> nodes;
  std::vector<Cell> cells;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> coincident;

  /// Splits a range of points in two along its longest side; false where all are in one place. Equal positions stay together.
  static bool split(std::span<Point> points, Node& node, std::size_t& below_count) {
    base::Bounds box{points[0].position, points[0].position};
    for (const Point& point : points) {
      const base::Vec3f& p = point.position;
      box.min = {std::min(box.min.x, p.x), std::min(box.min.y, p.y), std::min(box.min.z, p.z)};
      box.max = {std::max(box.max.x, p.x), std::max(box.max.y, p.y), std::max(box.max.z, p.z)};
    }
    const Shape shape(box);
    const auto longest = std::max_element(shape.side.begin(), shape.side.end());
    if (!(*longest > 0)) return false;
    const auto axis = static_cast<std::size_t>(longest - shape.side.begin());
    const auto at = [axis](const Point& point) { return coordinates(point.position)[axis]; };
    const auto middle = points.begin() + static_cast<std::ptrdiff_t>(points.size() / 2);
    std::nth_element(points.begin(), middle, points.end(),
                     [&](const Point& a, const Point& b) { return at(a) < at(b); });
    node.axis = static_cast<std::uint8_t>(axis);
    node.split = at(*middle);
    if (node.split == coordinates(box.min)[axis]) {
      node.split = std::numeric_limits<float>::infinity();
      for (const Point& point : points) {
        if (at(point) > coordinates(box.min)[axis]) node.split = std::min(node.split, at(point));
      }
    }
    const auto end = std::partition(points.begin(), points.end(), [&](const Point& p) { return at(p) < node.split; });
    below_count = static_cast<std::size_t>(end - points.begin());
    return true;
  }

  /// Leaves one vertex of each place at the front; returns how many.
  std::size_t weld(std::span<Point> points) {
    std::sort(points.begin(), points.end(), [](const Point& a, const Point& b) {
      return std::tuple(a.position.x, a.position.y, a.position.z, a.source) <
             std::tuple(b.position.x, b.position.y, b.position.z, b.source);
    });
    std::size_t count = 0;
    for (const Point& point : points) {
      if (count > 0 && points[count - 1].position == point.position) {
        coincident.emplace_back(points[count - 1].source, point.source);
      } else {
        points[count++] = point;
      }
    }
    return count;
  }

  void grow(std::span<Point> all, std::uint32_t at_node, std::uint32_t first, std::uint32_t last, bool is_welded) {
    std::span<Point> points = all.subspan(first, last - first);
    if (!is_welded && points.size() <= kWeldVertexCount) {
      last = first + static_cast<std::uint32_t>(weld(points));
      points = points.first(last - first);
      is_welded = true;
    }
    Node node;
    std::size_t below_count = 0;
    if ((is_welded && points.size() <= kCellVertexCount) || !split(points, node, below_count)) {
      if (!is_welded) {
        last = first + static_cast<std::uint32_t>(weld(points));
        points = points.first(last - first);
      }
      Cell cell;
      cell.begin = first;
      cell.end = last;
      cell.bounds = {points[0].position, points[0].position};
      for (const Point& point : points) {
        const base::Vec3f& p = point.position;
        base::Bounds& box = cell.bounds;
        box.min = {std::min(box.min.x, p.x), std::min(box.min.y, p.y), std::min(box.min.z, p.z)};
        box.max = {std::max(box.max.x, p.x), std::max(box.max.y, p.y), std::max(box.max.z, p.z)};
      }
      nodes[at_node].below = static_cast<std::uint32_t>(cells.size());
      cells.push_back(cell);
      return;
    }
    node.below = static_cast<std::uint32_t>(nodes.size());
    nodes[at_node] = node;
    nodes.resize(nodes.size() + 2);
    const std::uint32_t middle = first + static_cast<std::uint32_t>(below_count);
    grow(all, node.below, first, middle, is_welded);
    grow(all, node.below + 1, middle, last, is_welded);
  }
};

void PositionSteps::cut(jobs::WorkerPool& pool) {
  std::vector<Branch> branches;
  nodes_.resize(1);
  // The top, down to branches that are made in parallel.
  std::vector<Branch> open;
  open.push_back({0, static_cast<std::uint32_t>(points_.size()), 0, {}, {}, {}});
  while (!open.empty()) {
    Branch branch = std::move(open.back());
    open.pop_back();
    const std::span<Point> points = std::span(points_).subspan(branch.begin, branch.end - branch.begin);
    Node node;
    std::size_t below_count = 0;
    if (points.size() <= kBranchVertexCount || !Branch::split(points, node, below_count)) {
      branches.push_back(std::move(branch));
      continue;
    }
    node.below = static_cast<std::uint32_t>(nodes_.size());
    nodes_[branch.place] = node;
    nodes_.resize(nodes_.size() + 2);
    const std::uint32_t middle = branch.begin + static_cast<std::uint32_t>(below_count);
    open.push_back({branch.begin, middle, node.below, {}, {}, {}});
    open.push_back({middle, branch.end, node.below + 1, {}, {}, {}});
  }
  pool.for_each(branches.size(), [&](std::size_t i) {
    branches[i].nodes.resize(1);
    branches[i].grow(points_, 0, branches[i].begin, branches[i].end, false);
  });
  for (Branch& branch : branches) {
    const auto first_node = static_cast<std::uint32_t>(nodes_.size());
    const auto first_cell = static_cast<std::uint32_t>(cells_.size());
    // The first node has its place already.
    for (std::size_t i = 0; i < branch.nodes.size(); ++i) {
      Node node = branch.nodes[i];
      node.below += node.axis == kNoAxis ? first_cell : first_node - 1;
      if (i == 0) {
        nodes_[branch.place] = node;
      } else {
        nodes_.push_back(node);
      }
    }
    cells_.insert(cells_.end(), branch.cells.begin(), branch.cells.end());
    coincident_.insert(coincident_.end(), branch.coincident.begin(), branch.coincident.end());
  }
}

}  // namespace spectra::map
