#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "fusion/files/output_file.hpp"
#include "fusion/files/ply_fuse.hpp"
#include "fusion/registry.hpp"
#include "server/app/command_output.hpp"
#include "server/app/commands.hpp"
#include "server/app/interruption.hpp"
#include "server/app/progress_line.hpp"
#include "server/exports/fused_file.hpp"

namespace spectra::app {
namespace {

struct FusedFacts {
  std::vector<files::Note> notes;
  fusion::TemperatureSummary temperature;
};

ProgressStage writing(const FuseOptions& options, double weight) {
  return {base::kWritingPhase, "writing " + options.output.filename().string(), weight};
}

/// PLY to PLY, in constant memory whatever the size of the scene.
base::Result<FusedFacts> fused_in_blocks(const FuseOptions& options, const fusion::FusionSettings& settings) {
  ProgressLine line({{base::kReadingPhase, "reading " + options.input.filename().string(), 1},
                     {base::kHistogramPhase, "counting temperatures and hues", 0.5},
                     {base::kFusingPhase, "fusing to " + options.output.filename().string(), 2}});
  BOOST_OUTCOME_TRY(auto fused, files::fuse_ply(options.input, options.output, settings, watched(options.read, line)));
  return FusedFacts{std::move(fused.notes), fused.temperature};
}

/// To a file that needs no lattice.
base::Result<FusedFacts> fused_in_memory(const FuseOptions& options, const fusion::FusionSettings& settings,
                                         const exports::SceneFileOptions& file) {
  ProgressLine line(with_loading(options.input, options.thermal, {writing(options, 8)}));
  BOOST_OUTCOME_TRY(auto loaded, load_scene(options.input, options.thermal, watched(options.read, line)));
  const auto temperature = exports::temperature_of(loaded.mesh);
  BOOST_OUTCOME_TRY(const auto plan, fusion::FusionPlan::prepare(settings, temperature));
  BOOST_OUTCOME_TRYV(exports::write_scene_file(options.output, loaded.mesh, exports::fused_colours(loaded.mesh, plan),
                                               file, line.sink()));
  return FusedFacts{std::move(loaded.notes), temperature.summary};
}

/// To a Draco file on the lattice of the scene.
base::Result<FusedFacts> fused_on_lattice(const FuseOptions& options, const fusion::FusionSettings& settings,
                                          exports::SceneFileOptions file) {
  const double weight_of_writing = options.keeping == protocol::codec::DracoKeeping::Shape ? 4 : 2;
  ProgressLine line(with_loading(options.input, options.thermal,
                                 {{map::kTilingPhase, "cutting into tiles", 40}, writing(options, weight_of_writing)}));
  BOOST_OUTCOME_TRY(auto loaded, load_scene(options.input, options.thermal, watched(options.read, line)));
  auto notes = loaded.notes;
  jobs::WorkerPool pool(std::max(1U, std::thread::hardware_concurrency()));
  const auto scene = map::SceneSnapshot::build(std::move(loaded), 1, pool, map::kLeafVertexCount,
                                               map::LevelsOfDetail::LeavesOnly, line.sink());
  BOOST_OUTCOME_TRY(const auto plan, fusion::FusionPlan::prepare(settings, scene->temperature()));
  auto mesh = scene->whole_mesh();
  BOOST_OUTCOME_TRYV(exports::round_for_file(*scene, mesh, file));
  BOOST_OUTCOME_TRY(
      const auto losses,
      exports::write_scene_file(options.output, mesh, exports::fused_colours(mesh, plan), file, line.sink()));
  const auto has = [](std::string_view id) { return [id](const files::Note& note) { return note.id == id; }; };
  // The scene keeps vertices of no triangle, which it says; where the file does not, that is what counts.
  if (std::any_of(losses.begin(), losses.end(), has("left_out_vertices"))) {
    std::erase_if(notes, has("unreferenced_vertices"));
  }
  notes.insert(notes.end(), losses.begin(), losses.end());
  return FusedFacts{std::move(notes), scene->temperature().summary};
}

base::Result<FusedFacts> fused(const FuseOptions& options, const fusion::FusionSettings& settings,
                               exports::SceneFileFormat format) {
  exports::SceneFileOptions file;
  file.format = format;
  file.keeping = options.keeping;
  const bool is_lossless =
      format != exports::SceneFileFormat::Draco || file.keeping == protocol::codec::DracoKeeping::Everything;
  if (!is_lossless) return fused_on_lattice(options, settings, file);
  if (format == exports::SceneFileFormat::Ply && !options.thermal) return fused_in_blocks(options, settings);
  return fused_in_memory(options, settings, file);
}

}  // namespace

int run_fuse(const FuseOptions& options) {
  const Interruption interruption;
  const auto format = exports::scene_file_format(options.output.string());
  if (!format) {
    return fail(kWrongUsage, options.output.string() + ": the output must end in .ply, .glb or .drc");
  }
  std::error_code unknown;
  for (const auto& input : {std::optional(options.input), options.thermal}) {
    if (input && std::filesystem::equivalent(*input, options.output, unknown)) {
      return fail(kWrongUsage, options.output.string() + ": the output is the input, which would be lost");
    }
  }
  const auto settings = session::settings_from_text(options.settings);
  if (!settings) return fail(settings.error());
  if (const auto is_writable = files::OutputFile::check(options.output); !is_writable) return fail(is_writable.error());
  const auto facts = fused(options, settings.value(), *format);
  if (!facts) return fail(facts.error());
  print_notes(facts.value().notes);
  if (*format != exports::SceneFileFormat::Draco && options.keeping != protocol::codec::DracoKeeping::Shape) {
    print_notes({{"unused_options", 1,
                  "--keep-order and --lossless are for .drc files and have no effect on " + options.output.string()}});
  }
  const auto& temperature = facts.value().temperature;
  const bool has_any =
      temperature.has_temperature() || temperature.over_range_count + temperature.under_range_count > 0;
  if (!has_any && fusion::find_method(settings.value().method)->needs_temperature) {
    warn(options.input.string() + " has no temperatures: " +
         (settings.value().missing ? "all is written in the colour for missing ones"
                                   : "the visible colours are written"));
  }
  if (fusion::find_method(settings.value().method)->compares_with_baseline) {
    warn(options.input.string() +
         " has no baseline, which a file cannot hold: the visible colours are written. A map that is fed with blocks "
         "(spectra serve --live) remembers what was there before");
  }
  return kDone;
}

}  // namespace spectra::app
