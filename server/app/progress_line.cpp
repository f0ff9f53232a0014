#include "server/app/progress_line.hpp"

#include <poll.h>
#include <spdlog/fmt/fmt.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

namespace spectra::app {
namespace {

constexpr double kFirstSeconds = 0.4;  ///< What is done sooner needs no line.
constexpr std::chrono::milliseconds kDrawInterval{100};

std::atomic<bool> is_quiet{false};
std::mutex current_mutex;  // taken before that of a line
ProgressLine* current = nullptr;

/// A job in the background would be in the way of the one in front, or be stopped for it.
bool is_in_background() {
  const pid_t foreground = ::tcgetpgrp(STDERR_FILENO);
  return foreground != -1 && foreground != ::getpgrp();
}

std::size_t terminal_columns() {
  winsize size{};
  return ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

/// A terminal that was stopped (Ctrl+S) must not keep anybody waiting.
bool put(const std::string& text) {
  pollfd terminal{STDERR_FILENO, POLLOUT, 0};
  return ::poll(&terminal, 1, 0) == 1 && ::write(STDERR_FILENO, text.data(), text.size()) >= 0;
}

std::string duration_text(double seconds) {
  const auto whole = static_cast<long>(std::clamp(std::ceil(seconds), 1.0, 1e6));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 600) return fmt::format("{} min {} s", whole / 60, whole % 60);
  if (whole < 36'000) return fmt::format("{} min", (whole + 30) / 60);
  return fmt::format("{} h", (whole + 1800) / 3600);
}

/// Characters, each of one column: bytes that do not continue one of UTF-8.
std::size_t column_count(std::string_view text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0U) != 0x80U; }));
}

/// The first characters.
std::string_view shortened(std::string_view text, std::size_t columns) {
  std::size_t end = 0;
  while (end < text.size() && column_count(text.substr(0, end + 1)) <= columns) ++end;
  return text.substr(0, end);
}

}  // namespace

void RemainingTime::set(double share, double now_s) {
  constexpr double kLeastShare = 0.01;
  constexpr double kLeastSeconds = 0.3;
  if (share < kLeastShare || now_s < kLeastSeconds || (end_s_ && share == share_)) return;
  share_ = share;
  end_s_ = now_s / std::min(share, 1.0);
}

std::optional<double> RemainingTime::at(double now_s) const {
  if (!end_s_ || now_s > *end_s_) return std::nullopt;
  return *end_s_ - now_s;
}

double RemainingTime::share_at(double now_s) const {
  return end_s_ ? now_s / *end_s_ : 0;
}

std::string progress_text(std::string_view words, double share, std::optional<double> remaining_s,
                          std::size_t columns) {
  std::string facts = fmt::format("  {} %", static_cast<int>(100 * std::clamp(share, 0.0, 1.0)));
  if (remaining_s) facts += fmt::format(", about {} left", duration_text(*remaining_s));
  const std::size_t room = columns > facts.size() ? columns - facts.size() : 0;
  std::string text(shortened(words, room));
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < ' ' || c == '\x7f') c = '?';
  }
  text += facts;
  return std::string(shortened(text, columns));
}

ProgressLine::ProgressLine(std::vector<ProgressStage> stages)
    : stages_(std::move(stages)), is_shown_(!is_quiet && ::isatty(STDERR_FILENO) == 1) {
  if (!is_shown_) return;
  {
    const std::lock_guard lock(current_mutex);
    current = this;
  }
  drawer_ = std::thread([this] { draw_until_the_end(); });
}

ProgressLine::~ProgressLine() {
  end();
}

base::Progress ProgressLine::sink() {
  if (!is_shown_) return {};
  return [this](std::string_view phase, double share) { set(phase, share); };
}

void ProgressLine::end() {
  if (!drawer_.joinable()) return;
  {
    const std::lock_guard lock(current_mutex);
    current = nullptr;
  }
  {
    const std::lock_guard lock(mutex_);
    is_over_ = true;
    const bool is_complete = stage_ + 1 == stages_.size() && share_of_stage_ >= 1;
    if (drawn_columns_ > 0 && is_complete) draw();
    erase();
  }
  ended_.notify_all();
  drawer_.join();
}

void ProgressLine::make_way(bool for_good) {
  const std::lock_guard lock(current_mutex);
  if (current == nullptr) return;
  const std::lock_guard line_lock(current->mutex_);
  current->erase();
  current->is_over_ = current->is_over_ || for_good;
}

void ProgressLine::keep_quiet() {
  is_quiet = true;
}

void ProgressLine::set(std::string_view phase, double share) {
  const auto stage = std::find_if(stages_.begin(), stages_.end(), [&](const auto& s) { return s.phase == phase; });
  if (stage == stages_.end()) return;
  const std::lock_guard lock(mutex_);
  const auto index = static_cast<std::size_t>(stage - stages_.begin());
  if (index < stage_) return;
  // Jobs of several threads may report in another order than they were done in.
  share_of_stage_ = std::max(index > stage_ ? 0 : share_of_stage_, std::clamp(share, 0.0, 1.0));
  stage_ = index;
}

void ProgressLine::draw_until_the_end() {
  std::unique_lock lock(mutex_);
  ended_.wait_for(lock, std::chrono::duration<double>(kFirstSeconds), [this] { return is_over_; });
  while (!is_over_) {
    draw();
    ended_.wait_for(lock, kDrawInterval, [this] { return is_over_; });
  }
}

void ProgressLine::draw() {
  double done = 0;
  double whole = 0;
  for (std::size_t i = 0; i < stages_.size(); ++i) {
    whole += stages_[i].weight;
    done += i < stage_ ? stages_[i].weight : 0;
  }
  const double before = done;
  done += share_of_stage_ * stages_[stage_].weight;
  const double share = whole > 0 ? done / whole : 0;
  const double now_s = seconds();
  remaining_.set(share, now_s);
  // What tells nothing in between goes on as what came before it did, but not beyond its end.
  const double end_of_stage = whole > 0 ? (before + stages_[stage_].weight) / whole : 0;
  shown_share_ = std::max({shown_share_, share, std::min(remaining_.share_at(now_s), end_of_stage)});
  if (is_in_background()) return;
  // The last column stays free: some terminals go to the next line after it.
  const std::string text =
      progress_text(stages_[stage_].words, shown_share_, remaining_.at(now_s), terminal_columns() - 1);
  const std::size_t columns = column_count(text);
  std::string line = "\r" + text;
  if (columns < drawn_columns_) line.append(drawn_columns_ - columns, ' ');
  if (put(line)) drawn_columns_ = std::max(columns, drawn_columns_);
}

void ProgressLine::erase() {
  if (drawn_columns_ == 0) return;
  put("\r" + std::string(drawn_columns_, ' ') + "\r");
  drawn_columns_ = 0;
}

double ProgressLine::seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
}

}  // namespace spectra::app
