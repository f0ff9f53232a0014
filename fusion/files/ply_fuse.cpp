#include "fusion/files/ply_fuse.hpp"

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include "fusion/colour/hues.hpp"
#include "fusion/files/output_file.hpp"
#include "fusion/files/ply_encoder.hpp"
#include "fusion/files/ply_stream.hpp"
#include "fusion/files/scene_origin.hpp"
#include "fusion/files/told_coordinates.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"

namespace spectra::files {

namespace {

/// The first pass: what the fusion and the output's header must know of the whole.
struct FirstPass {
  PlyBodyFacts facts;
  fusion::TemperatureSummary temperature;
};

/// Calls `use` with the parts of a block that are no holes, as the first index and the number of vertices, and `use_hole`
/// with every hole between them.
template <class Use, class UseHole>
base::Result<void> for_each_part(const PlyVertexBlock& block, Use&& use, UseHole&& use_hole) {
  std::size_t begin = 0;
  for (const std::uint32_t hole : block.left_out) {
    BOOST_OUTCOME_TRY(use(begin, hole - begin));
    BOOST_OUTCOME_TRY(use_hole(hole));
    begin = hole + 1;
  }
  return use(begin, block.positions.size() - begin);
}

/// Calls `use` with the temperatures of the block's vertices that are not left out.
template <class Use>
base::Result<void> for_each_temperature(const PlyVertexBlock& block, Use&& use) {
  if (block.temperature_celsius.empty()) return base::success();
  return for_each_part(
      block,
      [&](std::size_t begin, std::size_t count) -> base::Result<void> {
        use(block.temperature_celsius.subspan(begin, count));
        return base::success();
      },
      [](std::uint32_t) -> base::Result<void> { return base::success(); });
}

base::Result<FirstPass> first_pass(PlyStream& stream) {
  std::optional<fusion::TemperatureAccumulator> temperatures(std::in_place);
  PlyHandlers handlers;
  handlers.vertices = [&](const PlyVertexBlock& block) {
    return for_each_temperature(block, [&](std::span<const float> celsius) { temperatures->add(celsius); });
  };
  BOOST_OUTCOME_TRY(PlyBodyFacts facts, stream.read(handlers));
  if (stream.leave_out_holes(facts)) {
    temperatures.emplace();
    BOOST_OUTCOME_TRY(facts, stream.read(handlers));
  }
  return FirstPass{facts, temperatures->summary()};
}

/// The histogram of the file, by another pass over it; the pass's error, if any, is kept in `error`.
fusion::Histogram file_histogram(PlyStream& stream, const fusion::TemperatureSummary& summary, std::uint32_t bins,
                                 std::optional<base::Error>& error) {
  fusion::Histogram histogram;
  histogram.minimum = summary.minimum;
  histogram.maximum = summary.maximum;
  histogram.counts.resize(bins);
  PlyHandlers handlers;
  handlers.vertices = [&](const PlyVertexBlock& block) {
    return for_each_temperature(block,
                                [&](std::span<const float> celsius) { fusion::add_to_histogram(celsius, histogram); });
  };
  if (auto facts = stream.read(handlers); !facts) error = std::move(facts).error();
  return histogram;
}

/// The hues of the file's colours, by another pass over it; the pass's error, if any, is kept in `error`.
fusion::Hues file_hues(PlyStream& stream, std::optional<base::Error>& error) {
  fusion::Hues hues;
  PlyHandlers handlers;
  handlers.vertices = [&](const PlyVertexBlock& block) -> base::Result<void> {
    if (block.visible.empty()) return base::success();
    return for_each_part(
        block,
        [&](std::size_t begin, std::size_t count) -> base::Result<void> {
          fusion::add_to_hues(block.visible.subspan(begin, count), hues);
          return base::success();
        },
        [](std::uint32_t) -> base::Result<void> { return base::success(); });
  };
  if (auto facts = stream.read(handlers); !facts) error = std::move(facts).error();
  return hues;
}

/// The last pass: every block fused and written. What the file does not have is filled in as MultispectralMesh does.
base::Result<void> fuse_and_write(PlyStream& stream, const PlyBodyFacts& facts, const fusion::FusionPlan& plan,
                                  const ReadOptions& options, PlyEncoder::Sink sink) {
  PlyLayout layout;
  layout.vertex_count = stream.vertex_count();
  layout.triangle_count = facts.faces.triangle_count;
  layout.origin = facts.origin;
  layout.double_positions = stream.has_double_positions(facts);
  layout.has_temperature = stream.has_temperature();
  layout.has_confidence = stream.has_confidence();
  layout.comment = comment_of(told_coordinates(stream.header().comments, options));
  PlyEncoder encoder(layout, std::move(sink));

  mesh::MultispectralMesh block_mesh;
  std::vector<base::Rgb8> fused;
  PlyHandlers handlers;
  handlers.vertices = [&](const PlyVertexBlock& block) -> base::Result<void> {
    const std::size_t count = block.positions.size();
    if (block_mesh.vertex_count() != count) block_mesh.resize_vertices(count);
    fused.resize(count);
    std::transform(block.positions.begin(), block.positions.end(), block_mesh.positions().begin(),
                   [&layout](const base::Vec3d& position) { return relative_to(layout.origin, position); });
    std::copy(block.visible.begin(), block.visible.end(), block_mesh.visible().begin());
    std::copy(block.temperature_celsius.begin(), block.temperature_celsius.end(),
              block_mesh.temperature_celsius().begin());
    plan.fuse(block_mesh.temperature_celsius(), block_mesh.visible(), fused);
    return for_each_part(
        block,
        [&](std::size_t begin, std::size_t part_count) {
          PlyConfidence confidence;
          if (layout.has_confidence) {
            confidence = {block.sigma_kelvin.subspan(begin, part_count), block.looked_at.subspan(begin, part_count)};
          }
          return encoder.vertices(block_mesh.positions().subspan(begin, part_count),
                                  std::span(fused).subspan(begin, part_count),
                                  block_mesh.temperature_celsius().subspan(begin, part_count), confidence);
        },
        [&](std::uint32_t hole) {
          return encoder.left_out_vertex(block.positions[hole], block_mesh.visible()[hole],
                                         block_mesh.temperature_celsius()[hole]);
        });
  };
  handlers.triangles = [&](std::span<const base::Triangle> triangles) { return encoder.triangles(triangles); };
  BOOST_OUTCOME_TRY(stream.read(handlers));
  return encoder.finish();
}

base::Result<FusedFile> fuse_file(const std::filesystem::path& in, const std::filesystem::path& out,
                                  const fusion::FusionSettings& settings, const fusion::PaletteTable* palette,
                                  const ReadOptions& options) {
  std::string_view phase = base::kReadingPhase;
  double begin_share = 0;
  double end_share = 1;
  ReadOptions watched = options;
  if (options.progress) {
    watched.progress = [&](std::string_view, double share) {
      options.progress(phase, begin_share + (end_share - begin_share) * share);
    };
  }
  BOOST_OUTCOME_TRY(PlyStream stream, PlyStream::open(in, watched));
  BOOST_OUTCOME_TRY(const FirstPass pass, first_pass(stream));
  std::optional<base::Error> pass_error;
  fusion::SceneTemperature scene;
  scene.summary = pass.temperature;
  // Nobody knows how many passes the plan will ask for, so each is half of what remains of their phase.
  const auto count_again = [&] {
    begin_share = phase == base::kHistogramPhase ? end_share : 0;
    end_share = (begin_share + 1) / 2;
    phase = base::kHistogramPhase;
  };
  scene.histogram = [&](std::uint32_t bins) {
    count_again();
    return file_histogram(stream, pass.temperature, bins, pass_error);
  };
  scene.hues = [&] {
    count_again();
    return file_hues(stream, pass_error);
  };
  auto plan = palette == nullptr ? fusion::FusionPlan::prepare(settings, scene)
                                 : fusion::FusionPlan::prepare(settings, scene, *palette);
  if (pass_error) return BOOST_OUTCOME_V2_NAMESPACE::failure(std::move(*pass_error));
  BOOST_OUTCOME_TRY(plan);

  phase = base::kFusingPhase;
  begin_share = 0;
  end_share = 1;
  BOOST_OUTCOME_TRY(OutputFile file, OutputFile::create(out));
  BOOST_OUTCOME_TRY(fuse_and_write(stream, pass.facts, plan.value(), options,
                                   [&file](std::span<const std::byte> bytes) { return file.write(bytes); }));
  BOOST_OUTCOME_TRY(file.commit());
  base::report(options.progress, phase, 1);
  return FusedFile{plan.value(), pass.temperature, stream.vertex_count(), pass.facts.faces.triangle_count,
                   stream.notes(pass.facts)};
}

}  // namespace

base::Result<FusedFile> fuse_ply(const std::filesystem::path& in, const std::filesystem::path& out,
                                 const fusion::FusionSettings& settings, const ReadOptions& options) {
  return fuse_file(in, out, settings, nullptr, options);
}

base::Result<FusedFile> fuse_ply(const std::filesystem::path& in, const std::filesystem::path& out,
                                 const fusion::FusionSettings& settings, const fusion::PaletteTable& palette,
                                 const ReadOptions& options) {
  return fuse_file(in, out, settings, &palette, options);
}

}  // namespace spectra::files
