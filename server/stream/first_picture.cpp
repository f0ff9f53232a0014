#include "server/stream/first_picture.hpp"

#include <utility>

#include "server/stream/frame_cache_state.hpp"
#include "server/stream/lattice.hpp"
#include "server/stream/stream_quality.hpp"
#include "server/stream/view_selection.hpp"

namespace spectra::stream {

void encode_first_picture(const std::shared_ptr<const map::SceneSnapshot>& scene, FrameCache& cache) {
  FrameCache::State& state = *cache.state();
  const StreamQuality quality;
  const float step_m = position_step_in_force(quality.position_step_m, scene->suggested_position_step_m());
  const ViewTree tree(*scene);
  for (const ViewTree::Node& node : tree.nodes()) {
    if (node.parent) continue;
    const GeometryKey key{Identity(node.tile), step_m, quality.encoder_speed};
    if (state.claim_geometry(key, {}).kind != Claim<EncodedTile>::Kind::Yours) continue;
    auto geometry = encoded_tile(*node.tile, step_m, quality.encoder_speed);
    if (geometry) {
      state.store_geometry(key, std::move(geometry).value());
    } else {
      state.abandon_geometry(key);
    }
  }
}

}  // namespace spectra::stream
