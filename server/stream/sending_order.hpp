#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "server/stream/viewer_tiles.hpp"

namespace spectra::stream {

/// The tiles that one viewer wants, as they are to be sent, and how far that has come. Not thread-safe: the stream's lock is
/// held.
class SendingOrder {
 public:
  /// A new order: marks the slots of `tiles` as wanted, target and preview, and puts down what is wanted no more or in
  /// another part.
  ///
  /// Coarse tiles whose place is taken by finer ones are previews, coloured first for a quick answer: the tops always,
  /// further levels as long as all previews together have at most `most_preview_vertices`.
  void choose(ViewerTiles& tiles, const std::vector<SelectedTile>& selected, double most_preview_vertices);
  void clear();

  /// Coarse before fine.
  const std::vector<std::shared_ptr<TileSlot>>& slots() const { return slots_; }

  /// Moves to the first slot that is not as demanded and waits for no other; null when there is none. What is as demanded is not
  /// looked at again before rewind(). After a tile in the place of one of before it is the first of which the viewer has nothing yet, if
  /// there is one: what changes all the time does not keep away what is lacking.
  TileSlot* head(const ViewerTiles& tiles, const Demand& demand);
  /// Something of a slot goes out that is in the place of what the viewer had of it, or not.
  void gave(bool is_in_place_of_before) { is_turn_of_lacking_ = is_in_place_of_before; }
  /// Where head() has come to.
  std::size_t head_index() const { return head_; }
  /// Any slot may have changed.
  void rewind() {
    first_ = 0;
    head_ = kNowhere;
  }

 private:
  void choose_previews(const ViewTree& tree, double most_vertices);

  std::vector<std::shared_ptr<TileSlot>> slots_;
  static constexpr auto kNowhere = std::numeric_limits<std::size_t>::max();

  std::size_t first_ = 0;  ///< Everything before it is satisfied.
  std::size_t head_ = kNowhere;
  bool is_turn_of_lacking_ = false;
  std::uint64_t choice_count_ = 0;
};

/// Vertices of the selected tiles that are to be drawn in the end.
std::uint64_t target_vertex_count(const ViewTree& tree, const std::vector<SelectedTile>& selected);

}  // namespace spectra::stream
