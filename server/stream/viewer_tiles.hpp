#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include "protocol/tile_frame.hpp"
#include "server/stream/demand.hpp"
#include "server/stream/subscription.hpp"
#include "server/stream/view_selection.hpp"
#include "server/stream/viewer_memory.hpp"

namespace spectra::stream {

/// What one viewer has and needs of one tile.
struct TileSlot {
  enum class Work {
    Idle,     ///< Nobody is at it.
    Busy,     ///< A job of this viewer encodes it.
    Waiting,  ///< A job of another viewer encodes it.
    Ready,    ///< `prepared` answers the present demand.
  };

  std::shared_ptr<const map::Tile> tile;
  std::size_t node = 0;  ///< In the tree.
  bool is_gone = false;  ///< No longer part of the scene, or the stream has ended.
  /// Of the scene: what had changed there by then has been given out. As of when the scene was replaced last.
  std::uint32_t shown_revision = 0;

  /// What the camera asks for.
  struct Wish {
    bool is_wanted = false;   ///< It, ...
    bool is_target = false;   ///< ... as a tile to be drawn in the end, not only until its children are there.
    bool is_preview = false;  ///< Coloured even when its children take its place.
    std::uint64_t last_wanted = 0;
  };
  /// While Ready: the frames that are next.
  struct Prepared {
    std::shared_ptr<const EncodedTile> geometry;
    Payload colours;
    int colour_bits = 0;            ///< Of `colours`.
    std::size_t counted_bytes = 0;  ///< Its share of ViewerTiles::prepared_bytes().
  };
  /// What was given out last; 0 = nothing.
  struct Held {
    std::uint32_t revision = 0;
    /// The revision of its geometry on the wire: it rises with each geometry of the tile, even when an encoding comes back that the viewer had before.
    std::uint32_t wire_revision = 0;
    std::uint32_t vertex_count = 0;
    std::uint8_t child_mask = 0;
    std::uint64_t bytes = 0;  ///< Decoded.
    std::uint64_t geometry_epoch = 0;
    std::uint64_t colour_epoch = 0;
    int colour_bits = 0;
    TileLook look;
    Picture picture;  ///< Of the colours; where they are from an earlier connection and not known, none.
    std::uint32_t colour_sequence = 0;  ///< Of the frame that brought the colours; 0: an earlier connection did.
    /// Of colours of an earlier version of the tile, which the viewer draws until those of this one are there.
    std::uint64_t earlier_colour_epoch = 0;
    bool had_raw_layers = false;  ///< The viewer has both raw layers of an earlier version.
    float position_step_m = 0;    ///< The coarsest of the tile.
    std::array<float, 3> origin_m{};
  };
  /// Of the demand for which the tile could not be encoded; 0 = none.
  struct Failed {
    std::uint64_t geometry_epoch = 0;
    std::uint64_t colour_epoch = 0;
  };
  /// A raw layer on its way to the viewer.
  struct Raw {
    Work work = Work::Idle;
    Payload payload;               ///< While Ready; of `held.revision`.
    std::uint64_t held_epoch = 0;  ///< Of RawDemand; 0 = the viewer does not have it.
    std::uint64_t failed_epoch = 0;
    /// Ready -> Idle; anything else stays as it is.
    void put_down() {
      if (work != Work::Ready) return;
      work = Work::Idle;
      payload = nullptr;
    }
  };

  Wish wish;
  Work work = Work::Idle;
  Prepared prepared;
  TileLook look;  ///< That is to be shown, and that `prepared.colours` have.
  Held held;
  Failed failed;
  std::array<Raw, RawDemand::kLayers.size()> raw;  ///< In the order of RawDemand::kLayers.

  int wanted_colour_bits(const Demand& demand) const {
    return wish.is_target ? demand.colour_bits : demand.preview_colour_bits;
  }
  /// Holds the newest colours, as exact as the tile's part in the picture asks for.
  bool has_colours(const Demand& demand) const {
    if (!demand.fused) return true;
    return held.colour_epoch == demand.colour_epoch && held.colour_bits >= wanted_colour_bits(demand) &&
           held.look == look;
  }
  /// Drawable, in the newest colours, however exact.
  bool has_newest_colours(const Demand& demand) const {
    return is_drawable() && held.colour_epoch == demand.colour_epoch;
  }
  /// With colours, or with what the viewer makes them of.
  bool is_drawable() const { return held.geometry_epoch != 0 && (held.colour_epoch != 0 || has_raw_layers()); }
  bool has_raw_layers() const {
    return std::all_of(raw.begin(), raw.begin() + RawDemand::kRawCount,
                       [](const Raw& layer) { return layer.held_epoch != 0; });
  }
  /// Holds that geometry, and a raw layer of it is wanted and not there.
  bool lacks_raw(std::size_t layer, const Demand& demand) const {
    const std::uint64_t epoch = demand.raw.epoch[layer];
    return demand.raw.is_wanted[layer] && !is_gone && wish.is_wanted && held.revision != 0 &&
           held.geometry_epoch == demand.geometry_epoch && raw[layer].held_epoch != epoch &&
           raw[layer].failed_epoch != epoch;
  }
  bool lacks_raw_layers(const Demand& demand) const {
    for (std::size_t layer = 0; layer < RawDemand::kRawCount; ++layer) {
      if (lacks_raw(layer, demand)) return true;
    }
    return false;
  }
  void forget_held();
  /// The viewer has no raw layers, nor are any ready for it.
  void forget_raw();
};

/// The tiles of the scene as one viewer has them: what is given out, what is prepared for it, and what it is to be told to
/// remove. Knows nothing of when and why. Not thread-safe: the stream's lock is held.
class ViewerTiles {
 public:
  /// The tiles of another scene. Those that both have stay as they are; of those that have changed the viewer holds
  /// something outdated; those that are gone are removed.
  void adopt(const map::SceneSnapshot& scene, const Demand& demand);
  /// The end: nothing is left, and jobs that are under way find their slots gone.
  void clear();

  const ViewTree& tree() const { return tree_; }
  /// One for each node of the tree.
  const std::vector<std::shared_ptr<TileSlot>>& slots() const { return slots_; }

  /// Ready with these frames.
  void make_ready(TileSlot& slot, std::shared_ptr<const EncodedTile> geometry, Payload colours, int colour_bits);
  /// Ready -> Idle; anything else stays as it is.
  void put_down(TileSlot& slot);
  /// What tiles are to look like from now on; what is Ready and looks otherwise is put down. Returns how many wanted ones are concerned.
  std::size_t set_looks(const LookRules& rules);
  /// When a look will be another, Unix seconds; infinite: never by time alone.
  double next_look_s() const { return next_look_s_; }

  /// The geometry of a Ready slot goes out under that name.
  void give_geometry(TileSlot& slot, std::uint32_t name, std::uint64_t geometry_epoch);
  /// The colours of a Ready slot go out, in the frame of that sequence.
  void give_colours(TileSlot& slot, const Demand& demand, std::uint32_t sequence);
  /// Bytes of all frames that are Ready and not given out.
  std::size_t prepared_bytes() const { return prepared_bytes_; }

  /// True when nothing is to be sent of the tile: it is as demanded, cannot be encoded, or is replaced by its children. What a
  /// viewer has of an earlier scene is good enough to be hidden behind them.
  bool is_satisfied(const TileSlot& slot, const Demand& demand) const;

  /// The viewer has something to draw of it, be it of an earlier version, or there will never be anything.
  static bool is_there(const TileSlot& slot, const Demand& demand);
  /// The scene's newest revision of which all that is to be drawn has been given out.
  std::uint32_t shown_revision(const Demand& demand) const;

  /// True when it would put something coarse, or nothing, in the place of what the viewer sees of an earlier version of the map, until
  /// others have come: it comes after those. A coarse tile beneath which there is something and something is lacking; a tile that takes
  /// the place of one of before while a new one is lacking beside it, which may have a part of that place.
  bool is_waiting(const TileSlot& slot, const Demand& demand) const;

  /// What the viewer has been given and not been told to remove.
  ViewerMemory memory() const;
  /// Takes a viewer at its word about what it holds from an earlier stream; see ViewerStream::resume(). Colours are current with
  /// `whole_bits` or more.
  Resumed resume(std::span<const ResumedTile> claims, const ViewerMemory& memory, const Demand& demand, int whole_bits,
                 const FrameCache::State& cache);
  /// Colours that were sent for one epoch are as demanded in another one, too, where they have at least so many bits.
  void keep_colours(std::uint64_t from_epoch, std::uint64_t to_epoch, int least_bits);
  /// A viewer that starts from nothing.
  void forget_all_held();

  void remove_from_viewer(TileSlot& slot);
  /// Removes tiles that are no longer part of the scene and whose places are drawn by those of now, of which `wanted` are wanted.
  void remove_succeeded(std::span<const std::shared_ptr<TileSlot>> wanted, const Demand& demand);
  /// There are some left.
  bool has_leaving() const { return !leaving_.empty(); }
  /// Removes tiles that are not wanted, the longest unwanted first, until what is wanted and what is held beside it
  /// takes at most so many bytes, decoded.
  void remove_surplus(std::uint64_t most_bytes);
  /// A viewer draws the children of a tile in its place when it has them all, whatever colours they have. Beneath a tile
  /// that now shows newer colours than they do, and that is fine enough, they would stay in front of it for good. Those of which
  /// nothing is drawn, because tiles beneath them have the newest colours, stay: without them the viewer would not draw these.
  void remove_outdated_beneath(const TileSlot& slot, const Demand& demand);

  bool has_removals() const { return !removals_.empty(); }
  /// The next remove frame; there is one.
  protocol::TileFrameHeader take_removal();

 private:
  /// A tile that is no longer part of the scene: the viewer draws it until its place is drawn by others.
  struct Leaving {
    base::Bounds bounds;
    TileSlot::Held held;
    std::uint32_t shown_revision = 0;
    /// Those in its place that are still to come; nothing before they are known.
    std::optional<std::set<protocol::TileId>> successors;
  };

  /// A tile of which the viewer holds something takes the place of one of before.
  static void succeed(TileSlot& slot, const TileSlot& before);
  bool is_lacking(const TileSlot& slot, const Demand& demand) const;
  /// It is to be drawn, and something of it has not been given out.
  bool is_to_come(const TileSlot& slot, const Demand& demand) const;
  bool is_anything_beneath(const TileSlot& slot) const;
  /// The viewer draws it, because it lacks some of those that it names.
  bool is_drawn(const TileSlot& slot, const Demand& demand) const;
  void remove_leaving();
  /// Whenever what is prepared of a slot or held of it has changed.
  void count_prepared(TileSlot& slot);
  bool are_children_drawable(const TileSlot& slot) const;
  /// All of it is drawn by tiles beneath of which this is so.
  template <class IsSo>
  bool is_made_up_beneath(const TileSlot& slot, const IsSo& is_so) const;
  /// All of it is drawn by tiles beneath that are as demanded.
  bool is_answered_beneath(const TileSlot& slot, const Demand& demand) const;
  /// All of it is drawn by tiles beneath under the settings of now, or made of raw layers, be it by earlier versions of them.
  bool is_hidden(const TileSlot& slot, const Demand& demand) const;
  /// All of it is drawn by tiles beneath that have the newest colours.
  bool is_covered(const TileSlot& slot, const Demand& demand) const;
  bool hold_resumed(TileSlot& slot, const ResumedTile& claim, const RememberedTile& before, const Demand& demand,
                    const FrameCache::State& cache);
  void abandon(TileSlot& slot);
  void push_removal(protocol::TileId tile, std::uint32_t revision);

  ViewTree tree_;
  std::vector<std::shared_ptr<TileSlot>> slots_;
  std::deque<protocol::TileFrameHeader> removals_;
  std::map<protocol::TileId, Leaving> leaving_;
  std::size_t prepared_bytes_ = 0;
  std::uint32_t scene_revision_ = 0;
  double next_look_s_ = std::numeric_limits<double>::infinity();
};

}  // namespace spectra::stream
