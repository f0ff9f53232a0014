#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "fusion/base/progress.hpp"

namespace spectra::app {

/// One part of a command's work.
struct ProgressStage {
  std::string_view phase;  ///< As the job names it.
  std::string words;       ///< As a person reads it.
  double weight = 1;       ///< About how long it takes, in any unit.
};

/// How long something will take, judged by how long its share so far took.
class RemainingTime {
 public:
  /// `share` (0 .. 1) of the whole is done `now_s` after the beginning; the same share again tells nothing new.
  void set(double share, double now_s);
  /// Seconds to the end, counted down while the share stays; nothing while it is too early to tell, or when that time is
  /// over and the share is still the same.
  std::optional<double> at(double now_s) const;
  /// What share is done by then, if all goes on like that; 0 while it is too early to tell.
  double share_at(double now_s) const;

 private:
  double share_ = 0;
  std::optional<double> end_s_;
};

/// "reading castle.ply  42 %, about 2 min 10 s left", in at most `columns` characters. Control characters are replaced.
std::string progress_text(std::string_view words, double share, std::optional<double> remaining_s, std::size_t columns);

/// Tells on standard error, when that is a terminal, what a command does, how far it is and how long it will take: one line
/// that appears after a moment, changes at most ten times a second, and is erased at the end. Only one at a time.
class ProgressLine {
 public:
  explicit ProgressLine(std::vector<ProgressStage> stages);
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// Where the jobs report; phases that are not among the stages are not shown. Not to be used after end().
  base::Progress sink();

  /// Erases the line, for good; where all was done it has told so.
  void end();

  /// Erases the line of the process, if there is one, so that something else can be written; it comes back by itself unless
  /// `for_good`.
  static void make_way(bool for_good = false);

  /// From now on no line is shown.
  static void keep_quiet();

 private:
  void set(std::string_view phase, double share);
  void draw_until_the_end();
  void draw();
  void erase();
  double seconds() const;

  const std::vector<ProgressStage> stages_;
  const std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  bool is_shown_ = false;  ///< There is a terminal and nobody asked for quiet.
  std::mutex mutex_;       ///< Of what follows and of the terminal.
  std::size_t stage_ = 0;
  double share_of_stage_ = 0;
  double shown_share_ = 0;  ///< Never less than before.
  bool is_over_ = false;
  RemainingTime remaining_;
  std::size_t drawn_columns_ = 0;
  std::condition_variable ended_;
  std::thread drawer_;
};

}  // namespace spectra::app
