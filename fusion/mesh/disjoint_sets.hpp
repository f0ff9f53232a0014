#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace spectra::mesh {

/// Sets that are united step by step; counts how many are left.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parents_(count), set_count_(count) {
    std::iota(parents_.begin(), parents_.end(), 0U);
  }

  void unite(std::uint32_t a, std::uint32_t b) {
    a = root(a);
    b = root(b);
    if (a == b) return;
    parents_[std::max(a, b)] = std::min(a, b);
    --set_count_;
  }

  /// The member that names the set: its smallest.
  std::uint32_t root(std::uint32_t item) {
    while (parents_[item] != item) item = parents_[item] = parents_[parents_[item]];
    return item;
  }

  std::size_t set_count() const { return set_count_; }

 private:
  std::vector<std::uint32_t> parents_;
  std::size_t set_count_;
};

}  // namespace spectra::mesh
