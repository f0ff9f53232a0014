#include "server/sources/unit_hand_over.hpp"

#include <spdlog/fmt/fmt.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <stdexcept>
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

void UnitHandOver::operator()(std::span<const mapping::PublishedUnit> units, const FeedMoment& moment,
                              jobs::WorkerPool& pool) {
  for (std::size_t first = 0; first < units.size(); first += kUnderWay) {
    if (is_over()) return;
    const auto some = units.subspan(first, std::min(kUnderWay, units.size() - first));
    auto blocks = mapping::block_plys(some, moment.begin_unix_s, pool);
    for (std::size_t i = 0; i < some.size(); ++i) {
      if (!blocks[i]) throw std::runtime_error(some[i].id + ": " + blocks[i].error().message);
      hand_over(some[i].id, std::move(blocks[i]).value(), moment);
    }
  }
}

void UnitHandOver::hand_over(const std::string& id, std::string ply, const FeedMoment& moment) {
  constexpr std::chrono::milliseconds kWait{10};
  // A map that is behind is waited for: what is told then is newer.
  while (state_->under_way >= kUnderWay && !state_->is_over) std::this_thread::sleep_for(kWait);
  if (state_->is_over) return;
  ++state_->under_way;
  const auto done = [state = state_, id](const auto& outcome) {
    --state->under_way;
    const auto* refusal = std::get_if<net::BlockRefusal>(&outcome);
    if (refusal == nullptr || state->is_over) return;
    // A map that is full refuses one after the other.
    constexpr std::size_t kSaidEvery = 1000;
    const std::size_t count = ++state->refused;
    if (count == 1 || count % kSaidEvery == 0)
      spdlog::warn("{} is refused: {} ({} units so far)", id, refusal->reason, count);
  };
  if (ply.empty()) {
    map_.remove(id, done, MapKeeper::WhenFull::Take);
    return;
  }
  auto block = incoming_block(id, unit_query(up_, moment.eye));
  if (!block) {
    --state_->under_way;
    throw std::runtime_error(id + ": " + block.error().message);
  }
  block.value().ply = std::make_shared<const std::string>(std::move(ply));
  map_.put(std::move(block).value(), done, MapKeeper::WhenFull::Take);
}

}  // namespace spectra::sources
