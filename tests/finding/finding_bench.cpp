// What each method marks at the settings that a person sees first: of the person in generated demo scenes, and of the hottest
// things in real scenes.
//
//   finding_bench [--seeds N] [--set METHOD name=value ...] [SCENE.ply THINGS]...
//
// THINGS is how many hottest things of the scene should be found. Without scenes: those of SPECTRA_TEST_DATA. `--set` tries
// other values of one method's parameters; `--sweep METHOD NAME FROM TO STEP` prints a line for each value.

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "fusion/demo/demo_scene.hpp"
#include "fusion/files/ply_reader.hpp"
#include "fusion/registry.hpp"
#include "tests/finding/finding.hpp"

namespace spectra::fusion {
namespace {

struct Trial {
  std::string name;
  std::unique_ptr<test::Surface> surface;
  std::vector<test::Thing> things;
};

struct Arguments {
  std::uint64_t seeds = 5;
  std::string method;  ///< Of --set and --sweep.
  fusion::ParameterValues params;
  std::string sweep;
  double from = 0, to = 0, step = 1;
  std::vector<std::pair<std::filesystem::path, std::size_t>> scenes;
};

std::vector<Trial> trials(const Arguments& arguments) {
  std::vector<Trial> list;
  for (std::uint64_t seed = 1; seed <= arguments.seeds; ++seed) {
    demo::LabelledDemoScene scene = demo::labelled_demo_scene({.vertex_count = 40'000, .seed = seed});
    auto surface = std::make_unique<test::Surface>(std::move(scene.mesh));
    std::vector<test::Thing> things = {test::thing_from(*surface, "person", std::move(scene.is_skin))};
    list.push_back({"demo " + std::to_string(seed), std::move(surface), std::move(things)});
  }
  for (const auto& [path, count] : arguments.scenes) {
    auto loaded = files::read_ply(path);
    if (!loaded) {
      std::fprintf(stderr, "%s: %s\n", path.c_str(), loaded.error().message.c_str());
      std::exit(1);
    }
    auto surface = std::make_unique<test::Surface>(std::move(loaded.value().mesh));
    std::vector<test::Thing> things = test::hottest_things(*surface, count);
    list.push_back({path.stem().string(), std::move(surface), std::move(things)});
  }
  return list;
}

void print_facts(const Trial& trial) {
  const fusion::TemperatureSummary& facts = trial.surface->facts.summary;
  std::printf("%-16s %8llu vertices, %.1f to %.1f degC, mean %.2f, sigma %.2f\n", trial.name.c_str(),
              static_cast<unsigned long long>(trial.surface->mesh.vertex_count()), double{facts.minimum},
              double{facts.maximum}, facts.mean, facts.sigma);
  for (const test::Thing& thing : trial.things) {
    double part = 0, all = 0, sum = 0;
    float hottest = facts.minimum, coldest = facts.maximum;
    base::Vec3f at{};
    for (std::size_t v = 0; v < thing.is_part.size(); ++v) {
      const float t = trial.surface->mesh.temperature_celsius()[v];
      const double area = trial.surface->area[v];
      all += area;
      if (thing.is_part[v] == 0 || !(t >= facts.minimum)) continue;
      part += area;
      sum += area * double{t};
      if (t >= hottest) at = trial.surface->mesh.positions()[v];
      hottest = std::max(hottest, t);
      coldest = std::min(coldest, t);
    }
    std::printf("  %-12s %.3f %% of the surface, %.1f to %.1f, mean %.1f degC, hottest at %.2f %.2f %.2f\n",
                thing.name.c_str(), 100 * part / all, double{coldest}, double{hottest}, sum / part, double{at.x},
                double{at.y}, double{at.z});
  }
}

/// One line a scene and thing; whether all reach what is asked for.
bool print_findings(const std::vector<Trial>& list, const fusion::Method& method,
                    const fusion::ParameterValues& params) {
  bool is_reached = true;
  for (const Trial& trial : list) {
    const fusion::FusionPlan plan = test::first_view_plan(*trial.surface, method.id, params);
    const auto found = test::findings(*trial.surface, plan, trial.things);
    for (std::size_t i = 0; i < found.size(); ++i) {
      const bool is_found = method.highlights ? found[i].thing_changed >= test::kLeastOfTheThing &&
                                                    found[i].rest_changed <= test::kMostOfTheRest
                                              : found[i].difference_from_ring >= test::kLeastDifference;
      is_reached = is_reached && is_found;
      std::printf("%-24s %-16s %-8s %5.1f %% of it, %5.1f %% of the rest, %5.1f from its ring%s\n", method.id.c_str(),
                  trial.name.c_str(), trial.things[i].name.c_str(), 100 * found[i].thing_changed,
                  100 * found[i].rest_changed, found[i].difference_from_ring, is_found ? "" : "   <-- not found");
    }
  }
  return is_reached;
}

Arguments parsed(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--seeds" && i + 1 < argc) {
      arguments.seeds = std::stoull(argv[++i]);
    } else if (word == "--set" && i + 2 < argc) {
      arguments.method = argv[++i];
      for (; i + 1 < argc && std::string(argv[i + 1]).find('=') != std::string::npos; ++i) {
        const std::string pair = argv[i + 1];
        const std::string name = pair.substr(0, pair.find('='));
        for (const fusion::Parameter& parameter : fusion::find_method(arguments.method)->parameters) {
          if (parameter.name == name) {
            arguments.params[name] = fusion::parse_parameter(parameter, pair.substr(name.size() + 1)).value();
          }
        }
      }
    } else if (word == "--sweep" && i + 5 < argc) {
      arguments.method = argv[++i];
      arguments.sweep = argv[++i];
      arguments.from = std::stod(argv[++i]);
      arguments.to = std::stod(argv[++i]);
      arguments.step = std::stod(argv[++i]);
    } else if (i + 1 < argc) {
      arguments.scenes.emplace_back(word, std::stoull(argv[++i]));
    }
  }
  const char* data = std::getenv("SPECTRA_TEST_DATA");
  if (arguments.scenes.empty() && data != nullptr) {
    for (const auto& [name, count] :
         {std::pair("mm5_256.ply", 1), std::pair("mm5_098.ply", 2), std::pair("arco_castle_250k.ply", 1)}) {
      arguments.scenes.emplace_back(std::filesystem::path(data) / name, count);
    }
  }
  return arguments;
}

int run(const Arguments& arguments) {
  const std::vector<Trial> list = trials(arguments);
  for (const Trial& trial : list) print_facts(trial);
  if (!arguments.sweep.empty()) {
    for (double value = arguments.from; value <= arguments.to + 1e-9; value += arguments.step) {
      std::printf("-- %s = %g\n", arguments.sweep.c_str(), value);
      fusion::ParameterValues params = arguments.params;
      params[arguments.sweep] = value;
      print_findings(list, *fusion::find_method(arguments.method), params);
    }
    return 0;
  }
  bool is_reached = true;
  for (const fusion::Method* method : fusion::all_methods()) {
    // What compares with a past shows nothing of a scene that has none.
    if (!method->needs_temperature || method->compares_with_baseline) continue;
    if (!arguments.method.empty() && arguments.method != method->id) continue;
    is_reached = print_findings(list, *method, arguments.params) && is_reached;
  }
  std::printf(is_reached ? "everything is found\n" : "not everything is found\n");
  return is_reached ? 0 : 1;
}

}  // namespace
}  // namespace spectra::fusion

int main(int argc, char** argv) {
  return spectra::fusion::run(spectra::fusion::parsed(argc, argv));
}
