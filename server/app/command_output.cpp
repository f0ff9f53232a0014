#include "server/app/command_output.hpp"

#include <cstdio>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>

#include "fusion/files/scene_survey.hpp"
#include "server/app/commands.hpp"
#include "server/app/progress_line.hpp"

namespace spectra::app {
namespace {

/// One line in one write, so that lines of several threads do not mix.
void print_line(std::string_view kind, std::string_view message) {
  std::string line = "spectra: ";
  line.append(kind).append(message);
  for (char& c : line) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  line += '\n';
  ProgressLine::make_way();
  std::fwrite(line.data(), 1, line.size(), stderr);
}

/// A file's name may be any bytes; whoever is told of it wants UTF-8.
std::string as_utf8(const std::string& bytes) {
  using nlohmann::json;
  return json::parse(json(bytes).dump(-1, ' ', false, json::error_handler_t::replace)).get<std::string>();
}

}  // namespace

int fail(int status, std::string_view message) {
  print_line("", message);
  return status;
}

int fail(const base::Error& error) {
  const bool is_usage = static_cast<int>(error.code) < static_cast<int>(base::ErrorCode::FileNotFound);
  return fail(is_usage ? kWrongUsage : kJobFailed, error.message);
}

void warn(std::string_view message) {
  print_line("warning: ", message);
}

void print_notes(const std::vector<files::Note>& notes) {
  for (const auto& note : notes) print_line("note: ", note.message);
}

std::vector<ProgressStage> with_loading(const std::filesystem::path& scene,
                                        const std::optional<std::filesystem::path>& thermal,
                                        std::vector<ProgressStage> next) {
  std::vector<ProgressStage> stages;
  if (thermal) stages.push_back({base::kReadingThermalPhase, "reading " + thermal->filename().string(), 1});
  stages.push_back({base::kReadingPhase, "reading " + scene.filename().string(), 1});
  if (thermal) stages.push_back({base::kJoiningPhase, "joining temperatures", 40});
  stages.push_back({base::kSurveyPhase, "surveying " + scene.filename().string(), 0.3});
  stages.insert(stages.end(), std::move_iterator(next.begin()), std::move_iterator(next.end()));
  return stages;
}

files::ReadOptions watched(files::ReadOptions options, ProgressLine& line) {
  options.progress = line.sink();
  return options;
}

base::Result<files::LoadedScene> load_scene(const std::filesystem::path& scene,
                                            const std::optional<std::filesystem::path>& thermal,
                                            const files::ReadOptions& options) {
  auto loaded = thermal ? files::read_ply_with_thermal(scene, *thermal, options) : files::read_ply(scene, options);
  base::report(options.progress, base::kSurveyPhase, 0);
  if (!loaded) return loaded;
  files::survey(loaded.value(), options);
  loaded.value().mesh.name = as_utf8(loaded.value().mesh.name);
  for (files::Note& note : loaded.value().notes) note.message = as_utf8(note.message);
  return loaded;
}

}  // namespace spectra::app
