// Loading, and loading and tiling, of a binary PLY against reading the same file with OpenMesh alone: time as a ratio
// and peak memory per vertex, each in a process of its own.
//
//   load_bench [SCENE.ply] [--repeat N]
//
// Without a file a scene of 1,000,000 vertices and about 2,000,000 triangles is generated. Ends with status 1 when the
// readers disagree about the mesh.
#include <malloc.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <OpenMesh/Core/IO/MeshIO.hh>
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "fusion/files/ply_reader.hpp"
#include "fusion/files/ply_writer.hpp"
#include "server/jobs/worker_pool.hpp"
#include "server/map/scene_snapshot.hpp"

namespace {

using namespace spectra;

/// What a reader made of the file, enough to tell whether two agree.
struct MeshSums {
  std::uint64_t vertex_count = 0;
  std::uint64_t triangle_count = 0;
  double position_sum = 0;
  std::uint64_t colour_sum = 0;
  std::uint64_t index_sum = 0;
  friend bool operator==(const MeshSums&, const MeshSums&) = default;
};

struct Measurement {
  double milliseconds = 0;
  double peak_bytes = 0;  ///< More than the process had before.
  MeshSums sums;
};

double resident_peak_bytes() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024;
}

/// Runs the job in a child process, so that its peak is its own. The job stops the clock itself by returning.
std::optional<Measurement> measured(const std::function<std::function<MeshSums()>()>& job) {
  int channel[2];
  if (::pipe(channel) != 0) return std::nullopt;
  std::fflush(stdout);
  const pid_t child = ::fork();
  if (child == 0) {
    Measurement result;
    const double before = resident_peak_bytes();
    const auto start = std::chrono::steady_clock::now();
    const auto sums = job();
    result.milliseconds = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    result.peak_bytes = resident_peak_bytes() - before;
    result.sums = sums();
    const bool is_written = ::write(channel[1], &result, sizeof(result)) == sizeof(result);
    ::_exit(is_written ? 0 : 1);
  }
  ::close(channel[1]);
  Measurement result;
  const bool is_read = ::read(channel[0], &result, sizeof(result)) == sizeof(result);
  ::close(channel[0]);
  int status = 0;
  ::waitpid(child, &status, 0);
  return is_read && status == 0 ? std::optional(result) : std::nullopt;
}

MeshSums sums_of(const mesh::MultispectralMesh& mesh) {
  MeshSums sums;
  sums.vertex_count = mesh.vertex_count();
  sums.triangle_count = mesh.triangle_count();
  for (const base::Vec3f& p : mesh.positions()) {
    sums.position_sum += static_cast<double>(p.x) + static_cast<double>(p.y) + static_cast<double>(p.z);
  }
  for (const base::Rgb8& colour : mesh.visible()) sums.colour_sum += std::uint64_t{colour.r} + colour.g + colour.b;
  for (const auto& [a, b, c] : mesh.triangles()) sums.index_sum += std::uint64_t{a} + b + c;
  return sums;
}

std::function<MeshSums()> read_with_spectra(const std::string& path) {
  auto scene = files::read_ply(path);
  if (!scene) {
    std::fprintf(stderr, "%s\n", scene.error().message.c_str());
    ::_exit(1);
  }
  auto mesh = std::make_shared<mesh::MultispectralMesh>(std::move(scene.value().mesh));
  return [mesh] { return sums_of(*mesh); };
}

std::function<MeshSums()> read_and_tile(const std::string& path) {
  auto scene = files::read_ply(path);
  if (!scene) {
    std::fprintf(stderr, "%s\n", scene.error().message.c_str());
    ::_exit(1);
  }
  jobs::WorkerPool pool(std::max(1U, std::thread::hardware_concurrency()));
  const auto snapshot = map::SceneSnapshot::build(std::move(scene.value().mesh), 1, pool);
  return [snapshot] {
    MeshSums sums;
    sums.vertex_count = snapshot->vertex_count();
    sums.triangle_count = snapshot->triangle_count();
    return sums;
  };
}

std::function<MeshSums()> read_with_openmesh(const std::string& path) {
  using Mesh = OpenMesh::TriMesh_ArrayKernelT<>;
  auto mesh = std::make_shared<Mesh>();
  mesh->request_vertex_colors();
  OpenMesh::IO::Options options(OpenMesh::IO::Options::VertexColor);
  if (!OpenMesh::IO::read_mesh(*mesh, path, options)) {
    std::fprintf(stderr, "OpenMesh cannot read %s\n", path.c_str());
    ::_exit(1);
  }
  return [mesh] {
    MeshSums sums;
    sums.vertex_count = mesh->n_vertices();
    sums.triangle_count = mesh->n_faces();
    for (const auto vertex : mesh->vertices()) {
      const auto& p = mesh->point(vertex);
      sums.position_sum += static_cast<double>(p[0]) + static_cast<double>(p[1]) + static_cast<double>(p[2]);
      const auto& colour = mesh->color(vertex);
      sums.colour_sum += std::uint64_t{colour[0]} + colour[1] + colour[2];
    }
    for (const auto face : mesh->faces()) {
      for (auto it = mesh->cfv_iter(face); it.is_valid(); ++it) {
        sums.index_sum += static_cast<std::uint64_t>((*it).idx());
      }
    }
    return sums;
  };
}

/// A wavy sheet of 1000 x 1000 vertices.
bool generate_scene(const std::filesystem::path& path) {
  constexpr std::uint32_t kSide = 1000;
  mesh::MultispectralMesh mesh;
  mesh.resize_vertices(std::size_t{kSide} * kSide);
  mesh.has_temperature = true;
  for (std::uint32_t v = 0; v < kSide * kSide; ++v) {
    const float x = static_cast<float>(v % kSide) * 0.01F;
    const float y = static_cast<float>(v / kSide) * 0.01F;
    mesh.positions()[v] = {x, y, std::sin(x) * std::cos(y)};
    mesh.visible()[v] = {static_cast<std::uint8_t>(v % 251), static_cast<std::uint8_t>(v % 241),
                         static_cast<std::uint8_t>(v % 239)};
    mesh.temperature_celsius()[v] = 20 + 5 * std::sin(3 * x + y);
  }
  for (std::uint32_t y = 0; y + 1 < kSide; ++y) {
    for (std::uint32_t x = 0; x + 1 < kSide; ++x) {
      const std::uint32_t v = y * kSide + x;
      mesh.triangles().push_back({v, v + 1, v + kSide});
      mesh.triangles().push_back({v + 1, v + kSide + 1, v + kSide});
    }
  }
  return files::write_ply(path, mesh, mesh.visible()).has_value();
}

struct Job {
  const char* name;
  std::function<MeshSums()> (*run)(const std::string&);
};

/// The fastest time and the smallest peak of some runs.
std::optional<Measurement> best_of(int repeat, const Job& job, const std::string& path) {
  std::optional<Measurement> best;
  for (int i = 0; i < repeat; ++i) {
    const auto result = measured([&] { return job.run(path); });
    if (!result) return std::nullopt;
    if (!best) best = result;
    best->milliseconds = std::min(best->milliseconds, result->milliseconds);
    best->peak_bytes = std::min(best->peak_bytes, result->peak_bytes);
  }
  return best;
}

}  // namespace

int main(int argument_count, char** arguments) {
  std::string path;
  int repeat = 5;
  for (int i = 1; i < argument_count; ++i) {
    if (std::strcmp(arguments[i], "--repeat") == 0 && i + 1 < argument_count) {
      repeat = std::max(1, std::atoi(arguments[++i]));
    } else {
      path = arguments[i];
    }
  }
  const std::filesystem::path generated =
      std::filesystem::temp_directory_path() / ("spectra-load-bench-" + std::to_string(::getpid()) + ".ply");
  if (path.empty()) {
    path = generated.string();
    if (!generate_scene(generated)) return 1;
    ::malloc_trim(0);
  }

  const Job jobs[] = {{"OpenMesh read", read_with_openmesh},
                      {"Spectra read", read_with_spectra},
                      {"Spectra read and tile", read_and_tile}};
  std::vector<Measurement> results;
  for (const Job& job : jobs) {
    const auto result = best_of(repeat, job, path);
    if (!result) return 1;
    results.push_back(*result);
  }
  std::filesystem::remove(generated);

  const MeshSums& sums = results[0].sums;
  const bool agree = results[1].sums == sums && results[2].sums.vertex_count == sums.vertex_count &&
                     results[2].sums.triangle_count == sums.triangle_count;
  std::printf("%llu vertices, %llu triangles; best of %d\n", static_cast<unsigned long long>(sums.vertex_count),
              static_cast<unsigned long long>(sums.triangle_count), repeat);
  std::printf("%-24s %10s %10s %14s\n", "", "ms", "ratio", "bytes/vertex");
  for (std::size_t i = 0; i < results.size(); ++i) {
    std::printf("%-24s %10.1f %10.3f %14.1f\n", jobs[i].name, results[i].milliseconds,
                results[i].milliseconds / results[0].milliseconds,
                results[i].peak_bytes / static_cast<double>(sums.vertex_count));
  }
  if (!agree) std::printf("the readers disagree about the mesh\n");
  return agree ? 0 : 1;
}
