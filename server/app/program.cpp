#include <CLI/CLI.hpp>
#include <array>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <functional>
#include <new>
#include <optional>
#include <string>
#include <variant>

#include "fusion/demo/demo_scene.hpp"
#include "fusion/files/ply_values.hpp"
#include "server/app/command_output.hpp"
#include "server/app/commands.hpp"
#include "server/app/config_file.hpp"
#include "server/app/progress_line.hpp"
#include "server/net/limit_table.hpp"
#include "server/session/version.hpp"
#include "server/store/time_text.hpp"

namespace spectra::app {
namespace {

using Run = std::function<int()>;
constexpr const char* kQuietHelp = "No progress on the terminal";

/// The options of every command that reads a scene: what a person knows of the file. Returns them.
std::vector<const CLI::Option*> add_reading(CLI::App& command, files::ReadOptions& options) {
  const auto before = static_cast<std::ptrdiff_t>(command.get_options().size());
  command.add_option("--temperature-property", options.temperature_property,
                     "The property that holds the temperature, whatever its name");
  const auto set_colours = [&options](const std::string& names) {
    auto properties = files::colour_properties(names);
    if (!properties) throw CLI::ValidationError("--colour-properties", properties.error().message);
    options.colour_properties = std::move(properties).value();
  };
  command.add_option_function<std::string>("--colour-properties", set_colours,
                                           "The properties that hold the colours, whatever their names: "
                                           "RED,GREEN,BLUE, or one that is grey or packed (rgb)");
  command.add_option("--colour-white", options.colour_white, "The number that is white in the file, such as 4095");
  const auto set_unit = [&options](const std::string& name) {
    options.temperature_unit = files::temperature_unit(name);
    if (!options.temperature_unit) {
      throw CLI::ValidationError("--temperature-unit " + name, "celsius, kelvin, centikelvin or fahrenheit is wanted");
    }
  };
  auto* unit = command.add_option_function<std::string>(
      "--temperature-unit", set_unit, "Of the file's temperatures: celsius, kelvin, centikelvin or fahrenheit");
  command.add_option("--temperature-scale", options.temperature_scale, "degC = A value + B: A")->excludes(unit);
  command.add_option("--temperature-offset", options.temperature_offset, "degC = A value + B: B")->excludes(unit);
  command.add_option("--no-data", options.no_data, "A temperature of the file that stands for none (may be repeated)")
      ->allow_extra_args(false);
  command.add_option("--scale", options.metres_per_unit, "Metres in one unit of the file's positions")
      ->capture_default_str();
  const auto set_up = [&options](const std::string& name) {
    options.up = base::up_axis_written(name);
    if (!options.up && name != "auto")
      throw CLI::ValidationError("--up " + name, "x, y, z, -x, -y, -z or auto is wanted");
  };
  command.add_option_function<std::string>("--up", set_up, "Which way is up: x, y, z, -x, -y, -z or auto");
  const CLI::Validator is_something([](const std::string& text) { return text.empty() ? "it is empty" : ""; }, "");
  const CLI::Validator is_number(
      [](const std::string& text) -> std::string {
        if (text.empty()) return "it is empty";
        if (files::parse_number(text)) return {};
        const bool has_comma = text.find(',') != std::string::npos;
        return text + " is no number" + (has_comma ? "; write it with a decimal point" : "");
      },
      "");
  command.get_option("--temperature-property")->check(is_something);
  command.get_option("--colour-properties")->check(is_something);
  for (const char* name : {"--colour-white", "--temperature-scale", "--temperature-offset", "--no-data", "--scale"}) {
    command.get_option(name)->check(is_number);
  }
  const auto all = command.get_options();
  return {all.begin() + before, all.end()};
}

void add_serve(CLI::App& app, ServeOptions& options, bool& is_demo, Run& run) {
  auto* command = app.add_subcommand("serve", "Serve a scene to browsers");
  auto* scene = command->add_option("scene", options.scene, "The scene, a PLY file; without one, the demo scene");
  command->add_option("--thermal", options.thermal, "A PLY file with the temperatures of the scene")->needs(scene);
  command->add_option("--listen", options.listen, "Where to listen, ADDRESS:PORT; port 0 picks a free one")
      ->capture_default_str();
  command->add_flag("--demo", is_demo, "Serve the demo scene")->excludes(scene);
  auto* frames =
      command
          ->add_option(
              "--map", options.frames,
              "Begin with an empty map and fill it with what is made of a folder of frames, or of those that a "
              "robot sends (live)")
          ->excludes(scene)
          ->excludes("--demo");
  command->add_flag("--demo-drive", options.is_demo_drive, "Begin with an empty map that a simulated robot fills")
      ->excludes(scene)
      ->excludes("--demo")
      ->excludes("--map");
  command
      ->add_option("--voxel", options.voxel_m, "The size of a voxel in metres, of --map (0.01) and --demo-drive (0.02)")
      ->check(CLI::Range(0.001, 1.0));
  auto* track =
      command
          ->add_flag("--track", options.is_tracking,
                     "With --map: find the poses from the frames; of those that are given only the one nearest to "
                     "the first depth picture counts")
          ->needs(frames);
  command
      ->add_flag("--submaps", options.has_submaps,
                 "With --map live: make the map in parts, which move when the robot sends corrected poses")
      ->needs(frames)
      ->excludes(track);
  command->add_flag("--live", options.is_live, "Begin with an empty map, made of the blocks that are put into it")
      ->excludes(scene)
      ->excludes("--demo");
  command
      ->add_option("--store", options.store, "The file that keeps the blocks of a live map; made when it is not there")
      ->excludes(scene)
      ->excludes("--demo");
  command
      ->add_option(
          "--history", options.history_bytes,
          "Bytes that earlier revisions of blocks may take in the store, such as 500MB (of 1000) or 500MiB (of 1024)")
      ->transform(CLI::AsSizeValue(true))
      ->transform(CLI::Validator(
          [](std::string& text) {
            return text.starts_with('-') ? std::string("a size of 0 bytes or more is wanted") : std::string();
          },
          ""))
      ->needs("--store")
      ->default_str("1GiB");
  const auto set_time = [&options](const std::string& text) {
    options.at = store::time_of(text);
    if (!options.at)
      throw CLI::ValidationError("--at " + text, "2026-01-31T12:34:56Z (or +01:00 for Z) or Unix seconds are wanted");
  };
  command->add_option_function<std::string>("--at", set_time, "Show the map of the store as it was at a time")
      ->needs("--store")
      ->excludes("--live");
  command->add_flag("--fused-only", options.is_fused_only,
                    "Give viewers fused colours only: no raw temperatures and colours to fuse by themselves");
  command->add_option("--allow-host", options.allowed_hosts, "A further host name to answer to (may be repeated)")
      ->allow_extra_args(false);
  command->add_option("--tokens", options.tokens, "Let in whom this file names; made by spectra token");
  auto* certificate =
      command->add_option("--certificate", options.certificate,
                          "Encrypt every connection (TLS): certificate in PEM form, with those that vouch "
                          "for it after it; spectra certificate makes one");
  command->add_option("--key", options.key, "The private key of the certificate, PEM")->needs(certificate);
  certificate->needs("--key");
  command
      ->add_flag(
          "--insecure", options.is_insecure,
          "On a network: let anybody watch and operate without a token; the map is changed from this machine alone")
      ->excludes("--tokens");
  const auto set_limits = [&options](const std::vector<std::string>& texts) {
    for (const std::string& text : texts) {
      if (const auto problem = net::set_limit(options.limits, text)) throw CLI::ValidationError("--limit " + *problem);
    }
  };
  command
      ->add_option_function<std::vector<std::string>>(
          "--limit", set_limits, "Another bound, NAME=VALUE (may be repeated); docs/limits.md has all of them")
      ->allow_extra_args(false);
  command->add_option("--log-format", options.log.format, "Of the log: text, or json with an object in each line")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
  command
      ->add_option("--log-level", options.log.level,
                   "What is logged: debug, info, warning or error, and what is graver")
      ->check(CLI::IsMember({"debug", "info", "warning", "error"}))
      ->capture_default_str();
  command->add_option("--log-file", options.log.file,
                      "Log to this file instead of standard error; at 10 MB it is begun anew, and five are kept");
  const auto set_invited = [&options](const std::string& role) {
    options.invited = access::access_role(role);
    if (!options.invited) throw CLI::ValidationError("--invite " + role, "viewer, operator, ingest or admin is wanted");
  };
  command->add_option_function<std::string>(
      "--invite", set_invited, "Print a link and a QR code that let one browser in, as viewer or operator");
  const auto reading = add_reading(*command, options.read);
  command->add_option("--web", options.web, "Folder of the built web client");
  command->add_option("--threads", options.thread_count, "Threads that fuse and encode; 0 = one a processor")
      ->check(CLI::Range(0, 1024));
  command->fallthrough();  // --config belongs to the whole program
  command->final_callback([&options, &run, reading] {
    for (const CLI::Option* option : reading) {
      if (!options.scene && option->count() > 0) {
        throw CLI::ValidationError(
            option->get_name(),
            "it says something of a scene file, and there is none; a block that is put says it in its query");
      }
    }
    run = [&options] { return run_serve(options); };
  });
}

/// What a Draco file is asked to keep.
struct KeepFlags {
  bool order = false;
  bool everything = false;
};

void add_fuse(CLI::App& app, FuseOptions& options, std::vector<std::string>& sets, KeepFlags& keep, Run& run) {
  auto* command = app.add_subcommand("fuse", "Write a fused scene to a file");
  command->add_option("input", options.input, "The scene, a PLY file")->required();
  command->add_option("output", options.output, "The file to write: .ply, .glb or .drc")->required();
  command->add_option("--method", options.settings.method, "The fusion method (see: spectra methods)")->required();
  command->add_option("--set", sets, "A parameter of the method, name=value (may be repeated)")
      ->allow_extra_args(false);
  command->add_option("--palette", options.settings.palette, "The palette (see: spectra methods)");
  command->add_option("--range", options.settings.range,
                      "The temperature range: auto, LO:HI in degC, or percentile[:LO:HI] in percent");
  command->add_option("--missing", options.settings.missing,
                      "Colour of vertices without temperature: visible or #rrggbb");
  command->add_option("--thermal", options.thermal, "A PLY file with the temperatures of the scene");
  add_reading(*command, options.read);
  command->add_flag("--keep-order", keep.order, "In a .drc: the scene's vertices and triangles in order and number");
  command->add_flag("--lossless", keep.everything, "In a .drc: that, and every position and temperature as it is");
  command->final_callback([&options, &sets, &keep, &run] {
    if (keep.order) options.keeping = protocol::codec::DracoKeeping::Order;
    if (keep.everything) options.keeping = protocol::codec::DracoKeeping::Everything;
    for (const auto& set : sets) {
      const auto equals = set.find('=');
      if (equals == std::string::npos || equals == 0)
        throw CLI::ValidationError("--set " + set, "name=value is wanted");
      options.settings.params.emplace_back(set.substr(0, equals), set.substr(equals + 1));
    }
    run = [&options] { return run_fuse(options); };
  });
}

void add_info(CLI::App& app, InfoOptions& options, Run& run) {
  auto* command = app.add_subcommand("info", "Say what is in a scene");
  command->add_option("input", options.input, "The scene, a PLY file")->required();
  command->add_option("--thermal", options.thermal, "A PLY file with the temperatures of the scene");
  add_reading(*command, options.read);
  command->add_flag("--json", options.as_json, "Write JSON");
  command->final_callback([&options, &run] { run = [&options] { return run_info(options); }; });
}

void add_methods(CLI::App& app, bool& as_json, Run& run) {
  auto* command = app.add_subcommand("methods", "List the fusion methods, their parameters, and the palettes");
  command->add_flag("--json", as_json, "Write the methods as JSON");
  command->final_callback([&as_json, &run] { run = [&as_json] { return run_methods(as_json); }; });
}

void add_demo_scene(CLI::App& app, DemoSceneFileOptions& options, Run& run) {
  auto* command = app.add_subcommand("demo-scene", "Write the generated demo scene to a PLY file");
  command->add_option("output", options.output, "The file to write")->required();
  command->add_option("--vertices", options.vertex_count, "About how many vertices")
      ->check(CLI::Range(demo::kDemoSceneLeastVertices, demo::kDemoSceneMostVertices))
      ->capture_default_str();
  command->add_option("--seed", options.seed, "Another number, another scene")->capture_default_str();
  command->final_callback([&options, &run] { run = [&options] { return run_demo_scene(options); }; });
}

void add_tradeoff(CLI::App& app, TradeoffCommandOptions& options, Run& run) {
  auto* command = app.add_subcommand("tradeoff", "Measure speed against accuracy on a scene");
  command->add_option("input", options.input, "The scene, a PLY file")->required();
  command->add_option("--out", options.folder, "Folder for the tables and the report")->required();
  command->add_option("--thermal", options.thermal, "A PLY file with the temperatures of the scene");
  add_reading(*command, options.read);
  command->add_option("--palette", options.palette, "The palette that the temperature is read back from");
  command->final_callback([&options, &run] { run = [&options] { return run_tradeoff(options); }; });
}

void add_push(CLI::App& app, PushOptions& options, Run& run) {
  auto* command = app.add_subcommand("push", "Put PLY files into the map of a server as blocks");
  command->add_option("input", options.input, "A PLY file, or a folder: all PLY files in it, in order of their names")
      ->required();
  command->add_option("--to", options.to, "The server, such as http://127.0.0.1:8080")->required();
  command->add_option("--rate", options.blocks_per_s, "Blocks a second at most")->check(CLI::Range(1e-3, 1e6));
  command->add_option("--id", options.id, "The name of the block, for one file; else the file's without its ending")
      ->check(CLI::Validator(
          [](const std::string& text) {
            return text.empty() ? std::string("an id has 1 to 64 letters") : std::string();
          },
          ""));
  const auto is_time = [](const std::string& text) {
    char* end = nullptr;
    const double seconds = std::strtod(text.c_str(), &end);
    const bool is_number = !text.empty() && *end == '\0' && std::isfinite(seconds);
    return text == "file" || text == "now" || is_number ? "" : "file, now or Unix seconds is wanted";
  };
  command
      ->add_option("--observed-at", options.observed_at,
                   "When it was seen: file (when the file was written), now, or Unix seconds")
      ->capture_default_str()
      ->check(CLI::Validator(is_time, ""));
  command->add_option("--token-file", options.token_file,
                      "A file that holds the token of the role ingest; else SPECTRA_TOKEN in the environment");
  command->add_option(
      "--ca", options.trusted,
      "With https://: whose certificates are trusted, or the server's own (PEM); else whom this machine trusts");
  add_reading(*command, options.read);
  command->final_callback([&options, &run] { run = [&options] { return run_push(options); }; });
}

void add_certificate(CLI::App& app, CertificateOptions& options, Run& run) {
  auto* command =
      app.add_subcommand("certificate", "Make a certificate that vouches for itself, and print its fingerprint");
  command->add_option("certificate", options.certificate, "The file to write it to, PEM")->required();
  command->add_option("key", options.key, "The file to write its private key to, PEM")->required();
  command
      ->add_option("--name", options.names,
                   "A host name or IP address of the server (may be repeated); else those of this machine")
      ->allow_extra_args(false);
  constexpr int kMostDays = 3650;
  command->add_option("--days", options.days, "How long it is good")
      ->check(CLI::Range(1, kMostDays))
      ->capture_default_str();
  command->add_flag("--replace", options.replaces, "Write over files that are there");
  command->final_callback([&options, &run] { run = [&options] { return run_certificate(options); }; });
}

void add_map(CLI::App& app, MapOptions& options, Run& run) {
  auto* command = app.add_subcommand("map", "Make a multispectral mesh of depth, colour and thermal frames");
  command->add_option("frames", options.frames, "A folder with frames.txt, poses.txt and calibration.json")->required();
  command->add_option("output", options.output, "The mesh to write, a PLY file");
  command->add_option("--to", options.to,
                      "A server to whose map it is sent while it grows, such as http://127.0.0.1:8080");
  command->add_option("--token-file", options.token_file,
                      "A file that holds the token of the role ingest; else SPECTRA_TOKEN in the environment");
  command->add_option("--voxel", options.voxel_m, "The size of a voxel in metres")
      ->check(CLI::Range(0.001, 1.0))
      ->capture_default_str();
  command->add_option("--poses", options.poses, "A file of poses in place of the folder's (TUM)");
  auto* corrected = command->add_option(
      "--corrected-poses", options.corrected_poses,
      "Poses of the same drive as they are known now (TUM): the map is made with the others, in submaps, which move");
  auto* track = command->add_flag("--track", options.is_tracking,
                                  "Find the poses from the frames; of those that are given only the one nearest to "
                                  "the first depth picture counts");
  track->excludes(corrected);
  command
      ->add_option("--save-poses", options.found_poses, "With --track: a file for the poses of the depth camera (TUM)")
      ->needs(track);
  command->add_option("--vignetting", options.vignetting, "A PFM picture: kelvin to subtract from each thermal pixel");
  command->add_option("--threads", options.thread_count, "Threads that map; 0 = one a processor")
      ->check(CLI::Range(0, 1024));
  command->final_callback([&options, &run] { run = [&options] { return run_map(options); }; });
}

void add_demo_frames(CLI::App& app, DemoFramesOptions& options, Run& run) {
  auto* command = app.add_subcommand("demo-frames", "Write the frames of a simulated drive through the demo office");
  command->add_option("folder", options.folder, "The folder to write them to")->required();
  command->add_option("--seconds", options.seconds, "How long the drive takes")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  command->add_option("--seed", options.seed, "Another number, another drive")->capture_default_str();
  command->add_option("--pose-drift", options.pose_drift_m, "How far the told poses wander in a second, metres")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  command->add_option("--clock-offset", options.clock_offset_s, "Seconds by which the thermal camera's stamps are late")
      ->check(CLI::Range(-1.0, 1.0))
      ->capture_default_str();
  command->final_callback([&options, &run] { run = [&options] { return run_demo_frames(options); }; });
}

void add_calibrate(CLI::App& app, CalibrateOptions& options, Run& run) {
  auto* command = app.add_subcommand("calibrate", "Find out about the thermal camera from frames");
  command->require_subcommand(1);
  auto* delay = command->add_subcommand("thermal-delay", "Find the delay between its timestamps and its pictures");
  delay->add_option("--within", options.within_s, "How far from what calibration.json says it is looked for, seconds")
      ->check(CLI::Range(0.02, 5.0))
      ->capture_default_str();
  delay->final_callback([&options, &run] { run = [&options] { return run_calibrate_delay(options); }; });
  auto* vignetting = command->add_subcommand("vignetting", "Find what it reads too much, by place in its picture");
  vignetting->final_callback([&options, &run] { run = [&options] { return run_calibrate_vignetting(options); }; });
  for (CLI::App* part : {delay, vignetting}) {
    part->add_option("frames", options.frames, "A folder with frames.txt, poses.txt and calibration.json")->required();
    if (part == vignetting) {
      part->add_option("output", options.output, "The picture to write, PFM: kelvin to subtract from each pixel")
          ->required();
    }
    part->add_option("--voxel", options.voxel_m, "The size of a voxel of the surface in metres")
        ->check(CLI::Range(0.001, 1.0))
        ->capture_default_str();
    part->add_option("--threads", options.thread_count, "Threads that work; 0 = one a processor")
        ->check(CLI::Range(0, 1024));
  }
}

void add_token(CLI::App& app, TokenOptions& options, Run& run) {
  auto* command = app.add_subcommand("token", "Make a token that a server lets in, or take one back");
  command->add_option("--file", options.file, "The file of the server's tokens; made when it is not there")->required();
  auto* role = command->add_option("--role", options.role, "viewer, operator, ingest or admin")
                   ->check(CLI::IsMember({"viewer", "operator", "ingest", "admin"}))
                   ->capture_default_str();
  auto* name = command->add_option("--name", options.name, "Whose it is: 1 to 32 of a-z A-Z 0-9 _ -");
  command->add_flag("--list", options.is_list, "Show roles and names")->excludes(role)->excludes(name);
  command->add_option("--remove", options.removed, "Take the token of this name back")
      ->excludes(role)
      ->excludes(name)
      ->excludes("--list");
  command->final_callback([&options, &run] { run = [&options] { return run_token(options); }; });
}

void add_store(CLI::App& app, std::filesystem::path& checked, StoreSalvageOptions& salvage, Run& run) {
  auto* command = app.add_subcommand("store", "Check or rescue the store of a map");
  command->require_subcommand(1);
  auto* check = command->add_subcommand("check", "Read the whole file and say whether everything is as it was put");
  check->add_option("file", checked, "The store")->required();
  check->final_callback([&checked, &run] { run = [&checked] { return run_store_check(checked); }; });
  auto* rescue = command->add_subcommand("salvage", "Write all that can be read of a damaged store into a new one");
  rescue->add_option("file", salvage.store, "The store; it is not changed")->required();
  rescue->add_option("new", salvage.output, "The new store, a file that is not there yet")->required();
  rescue->final_callback([&salvage, &run] { run = [&salvage] { return run_store_salvage(salvage); }; });
}

/// What went wrong with the arguments or a config file, in one line; the exit status.
int fail_to_parse(const CLI::ParseError& error, const std::string& hint) {
  const bool is_file = dynamic_cast<const CLI::FileError*>(&error) != nullptr;
  const bool is_placed = error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ConfigError);
  if (is_file) return fail(kJobFailed, error.what());
  return fail(kWrongUsage, is_placed ? error.what() : error.what() + hint);
}

/// The options of serve that a config file holds. Throws CLI::ParseError.
ServeOptions options_of_file(const std::filesystem::path& file) {
  CLI::App app("", "spectra");
  ServeOptions options;
  bool is_demo = false;
  Run run;
  add_serve(app, options, is_demo, run);
  auto* command = app.get_subcommand("serve");
  command->add_flag("--quiet", kQuietHelp);
  add_config_file(app, *command);
  const std::array arguments{"spectra", "serve", "--config", file.c_str()};
  app.parse(static_cast<int>(arguments.size()), arguments.data());
  options.has_config_file = true;
  return options;
}

void add_check_config(CLI::App& app, std::filesystem::path& file, Run& run) {
  auto* command = app.add_subcommand("check-config", "Say whether a config file of serve is good");
  command->add_option("file", file, "The file, TOML")->required();
  command->final_callback([&file, &run] {
    run = [&file] {
      try {
        return run_check_config(file, options_of_file(file));
      } catch (const CLI::ParseError& error) {
        return fail_to_parse(error, " (in " + file.string() + ')');
      }
    };
  });
}

void add_doctor(CLI::App& app, std::optional<std::filesystem::path>& file, Run& run) {
  auto* command = app.add_subcommand("doctor", "Say what this machine can do, and what would keep serve from working");
  command->add_option("--config", file, "The config file that serve is to be started with");
  command->final_callback([&file, &run] {
    run = [&file] {
      std::variant<ServeOptions, std::string> read;
      try {
        if (file) read = options_of_file(*file);
      } catch (const CLI::ParseError& error) {
        read = std::string(error.what());
      }
      return run_doctor(file, read);
    };
  });
}

int parse_and_run(int argc, const char* const* argv) {
  CLI::App app("Spectra: fuses visible and thermal 3D scenes and streams them to browsers", "spectra");
  app.set_version_flag("--version", "spectra " + std::string(session::kVersion));
  app.require_subcommand(1);
  app.set_help_all_flag("--help-all", "Print the help of every command and exit");
  ServeOptions serve;
  FuseOptions fuse;
  std::vector<std::string> sets;
  KeepFlags keep;
  InfoOptions info;
  bool methods_as_json = false;
  DemoSceneFileOptions demo_scene;
  TradeoffCommandOptions tradeoff;
  PushOptions push;
  MapOptions map;
  CalibrateOptions calibrate;
  DemoFramesOptions demo_frames;
  TokenOptions token;
  CertificateOptions certificate;
  std::filesystem::path checked_store;
  std::filesystem::path checked_config;
  std::optional<std::filesystem::path> examined_config;
  StoreSalvageOptions salvage;
  Run run;
  bool is_demo = false;  // what is served without a scene anyway
  add_serve(app, serve, is_demo, run);
  add_config_file(app, *app.get_subcommand("serve"));
  add_check_config(app, checked_config, run);
  add_doctor(app, examined_config, run);
  add_fuse(app, fuse, sets, keep, run);
  add_info(app, info, run);
  add_methods(app, methods_as_json, run);
  add_demo_scene(app, demo_scene, run);
  add_tradeoff(app, tradeoff, run);
  add_push(app, push, run);
  add_map(app, map, run);
  add_calibrate(app, calibrate, run);
  add_demo_frames(app, demo_frames, run);
  add_store(app, checked_store, salvage, run);
  add_token(app, token, run);
  add_certificate(app, certificate, run);
  bool is_quiet = false;
  app.add_flag("--quiet", is_quiet, kQuietHelp);
  for (auto* command : app.get_subcommands({})) {
    command->add_flag("--quiet", is_quiet, kQuietHelp);
    for (auto* part : command->get_subcommands({})) part->add_flag("--quiet", is_quiet, kQuietHelp);
  }
  // CLI11 would say that a command is missing, but not which word it did not know.
  const auto is_first_word = [argc, argv](const CLI::App* command) {
    return argc > 1 && command->get_name() == argv[1];
  };
  if (argc > 1 && argv[1][0] != '-' && app.get_subcommands(is_first_word).empty()) {
    return fail(kWrongUsage, "there is no command \"" + std::string(argv[1]) + "\" (see: spectra --help)");
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    const bool has_file = app.get_config_ptr()->count() > 0;
    return fail_to_parse(error, has_file
                                    ? " (with " + app.get_config_ptr()->as<std::string>() + "; see: spectra --help)"
                                    : " (see: spectra --help)");
  }
  serve.has_config_file = app.get_config_ptr()->count() > 0;
  if (is_quiet) ProgressLine::keep_quiet();
  return run();
}

}  // namespace

int run_program(int argc, const char* const* argv) {
  // Beyond a limit of file sizes a write fails and is told, as on a full disk.
  std::signal(SIGXFSZ, SIG_IGN);
  try {
    const int status = parse_and_run(argc, argv);
    if ((std::fflush(stdout) != 0 || std::ferror(stdout) != 0) && status == kDone) {
      return fail(kJobFailed, "standard output could not be written");
    }
    return status;
  } catch (const std::bad_alloc&) {
    return fail(kJobFailed, "out of memory");
  } catch (const std::exception& error) {
    return fail(kJobFailed, error.what());
  }
}

}  // namespace spectra::app
