#pragma once

#include <cstddef>
#include <cstdint>
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
  /// looked at again before rewind().
  TileSlot* head(const ViewerTiles& tiles, const Demand& demand);
  /// Where head() has come to.
  std::size_t head_index() const { return head_; }
  /// Any slot may have changed.
  void rewind() { head_ = first_ = 0; }

 private:
  void choose_previews(const ViewTree& tree, double most_vertices);

  std::vector<std::shared_ptr<TileSlot>> slots_;
  std::size_t first_ = 0;  ///< Everything before it is satisfied.
  std::size_t head_ = 0;   ///< Everything before it is satisfied, or waits.
  std::uint64_t choice_count_ = 0;
};

/// Vertices of the selected tiles that are to be drawn in the end.
std::uint64_t target_vertex_count(const ViewTree& tree, const std::vector<SelectedTile>& selected);

}  // namespace spectra::stream
