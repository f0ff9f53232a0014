#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <string>
#include <thread>
#include <utility>

#include "server/app/command_output.hpp"
#include "server/app/commands.hpp"
#include "server/app/fused_file.hpp"
#include "server/app/interruption.hpp"
#include "server/tradeoff/measure.hpp"
#include "server/tradeoff/report.hpp"

namespace spectra::server {

int run_tradeoff(const TradeoffCommandOptions& options) {
  const Interruption interruption;
  auto loaded = load_scene(options.input, options.thermal, options.read);
  if (!loaded) return fail(loaded.error());
  print_notes(loaded.value().notes);
  WorkerPool pool(std::max(1U, std::thread::hardware_concurrency()));
  const auto scene = SceneSnapshot::build(std::move(loaded.value()), 1, pool, kLeafVertexCount, LevelsOfDetail::All);
  const auto progress = [](const std::string& step) { fmt::print(stderr, "{}\n", step); };
  TradeoffOptions measured;
  if (!options.palette.empty()) measured.palette = options.palette;
  const auto measurement = measured_tradeoff(*scene, measured, progress);
  if (!measurement) return fail(measurement.error());
  const auto recommended = recommended_points(measurement.value(), {1, 5, 20, 100});
  const auto written = write_report(options.folder, measurement.value(), recommended);
  if (!written) return fail(written.error());
  fmt::print("{}report: {}\n", recommendation_text(recommended), (options.folder / "report.html").string());
  return kDone;
}

}  // namespace spectra::server
