#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <string>
#include <thread>
#include <utility>

#include "server/app/command_output.hpp"
#include "server/app/commands.hpp"
#include "server/app/interruption.hpp"
#include "server/app/progress_line.hpp"
#include "server/exports/fused_file.hpp"
#include "server/tradeoff/measure.hpp"
#include "server/tradeoff/report.hpp"

namespace spectra::app {

int run_tradeoff(const TradeoffCommandOptions& options) {
  const Interruption interruption;
  ProgressLine line(
      with_loading(options.input, options.thermal,
                   {{map::kTilingPhase, "cutting into tiles", 4}, {tradeoff::kMeasuringPhase, "measuring", 200}}));
  auto loaded = load_scene(options.input, options.thermal, watched(options.read, line));
  if (!loaded) return fail(loaded.error());
  print_notes(loaded.value().notes);
  jobs::WorkerPool pool(std::max(1U, std::thread::hardware_concurrency()));
  const auto scene = map::SceneSnapshot::build(std::move(loaded.value()), 1, pool, map::kLeafVertexCount,
                                               map::LevelsOfDetail::All, line.sink());
  tradeoff::TradeoffOptions measured;
  if (!options.palette.empty()) measured.palette = options.palette;
  const auto measurement = tradeoff::measured_tradeoff(*scene, measured, line.sink());
  line.end();
  if (!measurement) return fail(measurement.error());
  const auto recommended = tradeoff::recommended_points(measurement.value(), {1, 5, 20, 100});
  const auto written = tradeoff::write_report(options.folder, measurement.value(), recommended);
  if (!written) return fail(written.error());
  fmt::print("{}{}report: {}\n", tradeoff::recommendation_text(recommended), tradeoff::raw_text(measurement.value()),
             (options.folder / "report.html").string());
  return kDone;
}

}  // namespace spectra::app
