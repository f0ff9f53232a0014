#include "fusion/demo/demo_scene.hpp"

#include "fusion/files/output_file.hpp"
#include "fusion/files/ply_writer.hpp"
#include "server/app/command_output.hpp"
#include "server/app/commands.hpp"
#include "server/app/interruption.hpp"
#include "server/app/progress_line.hpp"

namespace spectra::app {

int run_demo_scene(const DemoSceneFileOptions& options) {
  if (const auto is_writable = files::OutputFile::check(options.output); !is_writable) return fail(is_writable.error());
  const Interruption interruption;
  ProgressLine line({{base::kModellingPhase, "modelling the demo scene", 14},
                     {base::kWritingPhase, "writing " + options.output.filename().string(), 1}});
  const auto mesh = demo::demo_scene({options.vertex_count, options.seed}, line.sink());
  const auto written = files::write_ply(options.output, mesh, mesh.visible(), {}, line.sink());
  line.end();
  return written ? kDone : fail(written.error());
}

}  // namespace spectra::app
