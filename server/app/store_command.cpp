#include <spdlog/fmt/fmt.h>

#include <filesystem>
#include <string>

#include "fusion/base/progress.hpp"
#include "fusion/files/output_file.hpp"
#include "server/app/command_output.hpp"
#include "server/app/commands.hpp"
#include "server/app/interruption.hpp"
#include "server/app/progress_line.hpp"
#include "server/store/salvage.hpp"
#include "server/store/store_file.hpp"
#include "server/store/time_text.hpp"

namespace spectra::app {
namespace {

std::string counted(std::uint64_t count, const char* one) {
  return fmt::format("{} {}{}", count, one, count == 1 ? "" : "s");
}

/// Beside an output that is written by SQLite stands its log.
void remove_log_of(const std::filesystem::path& unfinished) {
  std::error_code ignored;
  std::filesystem::remove(unfinished.string() + "-wal", ignored);
}

}  // namespace

int run_store_check(const std::filesystem::path& path) {
  auto opened = store::StoreFile::open(path.string(), {.is_read_only = true});
  if (!opened) return fail(kJobFailed, opened.error().message);
  store::StoreFile& file = *opened.value();
  const store::Catalogue catalogue = file.take_catalogue();
  ProgressLine line({{base::kReadingPhase, "reading " + path.filename().string(), 1}});
  const auto sink = line.sink();
  const auto wrong = file.check(catalogue, [&sink](double share) { base::report(sink, base::kReadingPhase, share); });
  line.end();
  if (!wrong) return fail(kJobFailed, wrong.error().message);
  for (const std::string& what : wrong.value()) warn(what);
  if (!wrong.value().empty()) {
    return fail(kJobFailed,
                fmt::format("{} is damaged: {} found; spectra store salvage {} NEW rescues what can be read",
                            path.string(), counted(wrong.value().size(), "fault"), path.string()));
  }
  fmt::print("{}: {}, {} bytes, revision {}; everything is as it was put\n", path.string(),
             counted(catalogue.block_count(), "block"), catalogue.block_bytes(), catalogue.last_revision());
  const std::uint64_t earlier = catalogue.row_count() - catalogue.block_count();
  if (catalogue.history_floor() > 0) {
    fmt::print("history: {}, {} bytes, complete from {} on\n", counted(earlier, "earlier revision"),
               catalogue.history_bytes(), store::utc_text(catalogue.history_floor_at()));
  } else {
    fmt::print("history: {}, {} bytes, complete from the beginning\n", counted(earlier, "earlier revision"),
               catalogue.history_bytes());
  }
  return kDone;
}

int run_store_salvage(const StoreSalvageOptions& options) {
  const Interruption interruption;
  std::error_code ignored;
  if (std::filesystem::exists(options.output, ignored)) {
    return fail(kWrongUsage, options.output.string() + " is there already; name a file that is not");
  }
  auto output = files::OutputFile::create(options.output);
  if (!output) return fail(output.error());
  const std::filesystem::path unfinished = output.value().unfinished();
  if (unfinished.empty()) return fail(kWrongUsage, options.output.string() + " is no place for a store; name a file");
  ProgressLine line({{base::kWritingPhase, "salvaging " + options.store.filename().string(), 1}});
  const auto sink = line.sink();
  const auto report = store::salvage(options.store.string(), unfinished.string(),
                                     [&sink](double share) { base::report(sink, base::kWritingPhase, share); });
  line.end();
  remove_log_of(unfinished);
  if (!report) return fail(kJobFailed, report.error().message);
  if (auto committed = output.value().commit(); !committed) return fail(committed.error());
  const auto& found = report.value();
  for (const std::string& what : found.lost) warn("lost: " + what);
  fmt::print("{}: {}, {}, {} rescued; {}\n", options.output.string(), counted(found.block_count, "block"),
             counted(found.earlier_count, "earlier revision"), counted(found.constant_count, "constant"),
             found.lost.empty() ? "nothing is lost" : "what is lost stands on standard error");
  return found.lost.empty() ? kDone : kJobFailed;
}

}  // namespace spectra::app
