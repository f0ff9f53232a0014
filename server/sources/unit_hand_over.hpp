#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/jobs/worker_pool.hpp"
#include "server/mapping/unit_publisher.hpp"
#include "server/sources/map_keeper.hpp"

namespace spectra::sources {

/// What is known when units are handed over.
struct FeedMoment {
  Eigen::Vector3d eye = Eigen::Vector3d::Zero();  ///< Where the depth camera is.
  double begin_unix_s = 0;                        ///< When the map's first moment was.
};

/// Unix seconds.
double unix_now_s();

/// What a block that is a unit is asked to be read with, and when it was seen: now. `up` may be empty.
std::vector<std::pair<std::string, std::string>> unit_query(const std::string& up, const Eigen::Vector3d& eye);

/// Puts units into a map, at most kUnderWay at a time. For one thread, but for end().
class UnitHandOver {
 public:
  static constexpr std::size_t kUnderWay = 32;

  UnitHandOver(MapKeeper& map, std::string_view up) : map_(map), up_(up) {}

  /// After end() nothing is put any more. Throws std::runtime_error when a unit cannot be made a block. `pool`: makes blocks beside this thread.
  void operator()(std::span<const mapping::PublishedUnit> units, const FeedMoment& moment, jobs::WorkerPool& pool);

  /// Units that it would take now without waiting.
  std::size_t room() const;
  /// Units that the map has refused.
  std::size_t refused_count() const { return state_->refused; }

  /// From any thread: nothing is waited for any more.
  void end() { state_->is_over = true; }
  bool is_over() const { return state_->is_over; }

 private:
  /// A unit without a surface has no bytes.
  void hand_over(const std::string& id, std::string ply, const FeedMoment& moment);

  MapKeeper& map_;
  const std::string up_;
  /// Shared with answers that may come when this is gone.
  struct State {
    std::atomic<bool> is_over{false};
    std::atomic<std::size_t> under_way{0}, refused{0};
  };
  const std::shared_ptr<State> state_ = std::make_shared<State>();
};

}  // namespace spectra::sources
