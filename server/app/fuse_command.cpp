#include <string>

#include "fusion/registry.hpp"
#include "server/app/command_output.hpp"
#include "server/app/commands.hpp"
#include "server/app/fused_file.hpp"

namespace spectra::server {

int run_fuse(const FuseOptions& options) {
  const auto format = scene_file_format(options.output.string());
  if (!format) {
    return fail(kWrongUsage, options.output.string() + ": the output must end in .ply, .glb or .drc");
  }
  const auto settings = settings_from_text(options.settings);
  if (!settings) return fail(settings.error());
  auto loaded = load_scene(options.input, options.thermal);
  if (!loaded) return fail(loaded.error());
  const auto& mesh = loaded.value().mesh;
  print_notes(loaded.value().notes);

  const auto temperature = temperature_of(mesh);
  if (!temperature.summary.has_temperature() && fusion::find_method(settings.value().method)->needs_temperature) {
    warn(options.input.string() + " has no temperatures: the visible colours are written");
  }
  const auto plan = fusion::FusionPlan::prepare(settings.value(), temperature);
  if (!plan) return fail(plan.error());
  const auto written = write_scene_file(options.output, mesh, fused_colours(mesh, plan.value()), *format);
  return written ? kDone : fail(written.error());
}

}  // namespace spectra::server
