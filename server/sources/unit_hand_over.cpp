#include "server/sources/unit_hand_over.hpp"

#include <spdlog/fmt/fmt.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <thread>

#include "server/mapping/map_ply.hpp"
#include "server/sources/block_options.hpp"

namespace spectra::sources {

double unix_now_s() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

std::vector<std::pair<std::string, std::string>> unit_query(const std::string& up, const Eigen::Vector3d& eye) {
  std::vector<std::pair<std::string, std::string>> query{
      {"observed_at", fmt::format("{:.3f}", unix_now_s())},
      {"sensor", fmt::format("{:.3f},{:.3f},{:.3f}", eye.x(), eye.y(), eye.z())},
      {"scale", "1"}};
  if (!up.empty()) query.emplace_back("up", up);
  return query;
}

std::size_t UnitHandOver::room() const {
  const std::size_t under_way = state_->under_way;
  return under_way < kUnderWay ? kUnderWay - under_way : 0;
}

bool UnitHandOver::operator()(std::vector<mapping::PublishedUnit> units, const FeedMoment& moment) {
  constexpr std::chrono::milliseconds kWait{10};
  for (mapping::PublishedUnit& unit : units) {
    // A map that is behind is waited for: what is told then is newer.
    while (state_->under_way >= kUnderWay) {
      if (state_->is_over) return false;
      std::this_thread::sleep_for(kWait);
    }
    ++state_->under_way;
    const auto done = [state = state_, id = unit.id](const auto& outcome) {
      --state->under_way;
      const auto* refusal = std::get_if<net::BlockRefusal>(&outcome);
      if (refusal == nullptr || state->is_over) return;
      // A map that is full refuses one after the other.
      constexpr std::size_t kSaidEvery = 1000;
      const std::size_t count = ++state->refused;
      if (count == 1 || count % kSaidEvery == 0)
        spdlog::warn("{} is refused: {} ({} units so far)", id, refusal->reason, count);
    };
    if (unit.mesh.triangles.empty()) {
      map_.remove(unit.id, done, MapKeeper::WhenFull::Take);
      continue;
    }
    auto block = incoming_block(unit.id, unit_query(up_, moment.eye));
    if (!block) {
      --state_->under_way;
      spdlog::error("{}: {}", unit.id, block.error().message);
      return false;
    }
    block.value().ply = std::make_shared<const std::string>(mapping::block_ply(unit.mesh, moment.begin_unix_s));
    map_.put(std::move(block).value(), done, MapKeeper::WhenFull::Take);
  }
  return !state_->is_over;
}

}  // namespace spectra::sources
