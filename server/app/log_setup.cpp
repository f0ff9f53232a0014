#include "server/app/log_setup.hpp"

#include <fmt/chrono.h>
#include <spdlog/formatter.h>
#include <spdlog/sinks/rotating_file_sink.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "server/app/progress_line.hpp"

namespace spectra::app {
namespace {

constexpr std::size_t kFileBytes = 10'000'000;
constexpr std::size_t kFilesKept = 5;
constexpr const char* kTextPattern = "%Y-%m-%d %H:%M:%S.%e %l %v";

/// Standard error, where the line of progress makes way.
class TerminalSink final : public spdlog::sinks::stderr_color_sink_mt {
 public:
  void log(const spdlog::details::log_msg& message) override {
    ProgressLine::make_way();
    spdlog::sinks::stderr_color_sink_mt::log(message);
  }
};

class JsonFormatter final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& into) override {
    using std::chrono::milliseconds;
    const auto since_1970 = std::chrono::floor<milliseconds>(message.time.time_since_epoch());
    const auto seconds = std::chrono::floor<std::chrono::seconds>(since_1970);
    const auto level = spdlog::level::to_string_view(message.level);
    const nlohmann::ordered_json line{
        {"time", fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03}Z", fmt::gmtime(static_cast<std::time_t>(seconds.count())),
                             (since_1970 - seconds).count())},
        {"level", std::string_view(level.data(), level.size())},
        {"message", std::string_view(message.payload.data(), message.payload.size())}};
    // What is no UTF-8 (a path, words of a peer) is replaced, and the line stays one.
    const std::string text = line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
    into.append(text.data(), text.data() + text.size());
  }
  std::unique_ptr<spdlog::formatter> clone() const override { return std::make_unique<JsonFormatter>(); }
};

}  // namespace

std::optional<std::string> set_up_log(const LogOptions& options) {
  std::shared_ptr<spdlog::sinks::sink> sink;
  try {
    if (options.file) {
      sink = std::make_shared<spdlog::sinks::rotating_file_sink_mt>(options.file->string(), kFileBytes, kFilesKept);
    } else {
      sink = std::make_shared<TerminalSink>();
    }
  } catch (const spdlog::spdlog_ex& error) {
    return options.file->string() + " cannot be written: " + error.what();
  }
  auto logger = std::make_shared<spdlog::logger>("spectra", std::move(sink));
  if (options.format == "json") {
    logger->set_formatter(std::make_unique<JsonFormatter>());
  } else {
    logger->set_pattern(kTextPattern);
  }
  logger->set_level(spdlog::level::from_str(options.level));
  // A file is looked at while the server runs.
  if (options.file) logger->flush_on(spdlog::level::info);
  spdlog::set_default_logger(std::move(logger));
  return std::nullopt;
}

}  // namespace spectra::app
