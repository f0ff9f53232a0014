#include "server/map/octant_groups.hpp"

#include <algorithm>
#include <bit>
#include <optional>
#include <tuple>
#include <utility>

namespace spectra::map {
namespace {

int distance(const OctantGroup& a, const OctantGroup& b) {
  int smallest = 3;
  for (unsigned i = 0; i < 8; ++i) {
    for (unsigned j = 0; j < 8; ++j) {
      if ((a.octants >> i & 1) != 0 && (b.octants >> j & 1) != 0) smallest = std::min(smallest, std::popcount(i ^ j));
    }
  }
  return smallest;
}

}  // namespace

std::vector<OctantGroup> octant_groups(const OctantContents& counts,
                                       const std::function<std::uint64_t(const CellContent&)>& leaf_size,
                                       bool has_triangles) {
  std::vector<OctantGroup> groups;
  for (unsigned i = 0; i < 8; ++i) {
    if (!counts[i].is_empty()) groups.push_back({1u << i, counts[i], i});
  }
  const auto join = [&](std::size_t a, std::size_t b) {
    OctantGroup& into = groups[std::min(a, b)];
    const OctantGroup& from = groups[std::max(a, b)];
    if (counts[from.heaviest].owned_count > counts[into.heaviest].owned_count) into.heaviest = from.heaviest;
    into.octants |= from.octants;
    into.count += from.count;
    groups.erase(groups.begin() + static_cast<std::ptrdiff_t>(std::max(a, b)));
  };
  while (groups.size() > 1) {
    // Neighbours that fit into one leaf together, the lightest pair first.
    std::optional<std::tuple<std::uint64_t, std::size_t, std::size_t>> best;
    for (std::size_t a = 0; a < groups.size(); ++a) {
      for (std::size_t b = a + 1; b < groups.size(); ++b) {
        CellContent both = groups[a].count;
        both += groups[b].count;
        const std::uint64_t sum = both.owned_count;
        if (sum > leaf_size(both) || distance(groups[a], groups[b]) > 1) continue;
        if (!best || std::tuple(sum, a, b) < *best) best = {sum, a, b};
      }
    }
    if (best) {
      join(std::get<1>(*best), std::get<2>(*best));
      continue;
    }
    // A small one, with the nearest other.
    std::optional<std::pair<std::uint64_t, std::size_t>> smallest;
    for (std::size_t a = 0; a < groups.size(); ++a) {
      const bool is_bare = has_triangles && groups[a].count.triangle_count == 0;
      const bool is_small = 4 * groups[a].count.owned_count < leaf_size(groups[a].count);
      if (!is_bare && !is_small) continue;
      const std::pair candidate(groups[a].count.owned_count, a);
      if (!smallest || candidate < *smallest) smallest = candidate;
    }
    if (!smallest) break;
    const std::size_t a = smallest->second;
    std::optional<std::tuple<int, std::uint64_t, std::size_t>> nearest;
    for (std::size_t b = 0; b < groups.size(); ++b) {
      if (b == a) continue;
      const std::tuple candidate(distance(groups[a], groups[b]), groups[b].count.owned_count, b);
      if (!nearest || candidate < *nearest) nearest = candidate;
    }
    join(a, std::get<2>(*nearest));
  }
  return groups;
}

}  // namespace spectra::map
