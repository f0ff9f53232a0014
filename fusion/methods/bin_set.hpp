#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace spectra::fusion {

/// Some of a histogram's bins, a bit each; one more bit, never set, stands for what is in no bin.
class BinSet {
 public:
  explicit BinSet(std::size_t bin_count) : word_count_(bin_count / kWordBits + 1), words_(word_count_ + kPad) {}
  void insert(std::size_t bin) { words_[bin / kWordBits] |= 1U << (bin % kWordBits); }

  std::size_t word_count() const { return word_count_; }
  /// Bin i is bit i % 32 of word i / 32. A whole register may be read from here.
  const std::uint32_t* words() const { return words_.data(); }

 private:
  static constexpr std::size_t kWordBits = 32;
  static constexpr std::size_t kPad = 16;
  std::size_t word_count_;
  std::vector<std::uint32_t> words_;
};

}  // namespace spectra::fusion
