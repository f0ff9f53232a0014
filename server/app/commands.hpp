#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "fusion/files/read_options.hpp"
#include "protocol/codec/draco_file.hpp"
#include "server/access/role.hpp"
#include "server/app/log_setup.hpp"
#include "server/net/net_options.hpp"
#include "server/session/settings_text.hpp"
#include "server/store/block_store.hpp"

namespace spectra::app {

/// Exit statuses of the program.
inline constexpr int kDone = 0;
inline constexpr int kJobFailed = 1;
inline constexpr int kWrongUsage = 2;

struct ServeOptions {
  std::optional<std::filesystem::path> scene;  ///< Absent: the demo scene.
  std::optional<std::filesystem::path> thermal;
  std::optional<std::filesystem::path> frames;  ///< Mapped into a live map.
  bool is_demo_drive = false;                   ///< A simulated robot maps into a live map.
  std::optional<double> voxel_m;                ///< Of what is mapped.
  bool is_tracking = false;                     ///< Its poses are found from what is seen.
  bool has_submaps = false;                     ///< It is made in parts, which corrected poses move.
  bool is_live = false;                         ///< Begins with an empty map.
  std::optional<std::filesystem::path> store;   ///< Keeps the blocks of a live map.
  std::uint64_t history_bytes = store::StoreOptions{}.history_bytes;  ///< Of the store.
  std::optional<store::StoreTime> at;  ///< The map of the store is shown as it was then, and takes no blocks.
  std::string listen = "127.0.0.1:8080";
  std::vector<std::string> allowed_hosts;
  std::optional<std::filesystem::path> tokens;            ///< Whom to let in; absent: what the environment says.
  std::optional<std::filesystem::path> certificate, key;  ///< PEM; both: connections are encrypted.
  net::NetLimits limits;
  LogOptions log;
  bool is_insecure = false;                   ///< Others are let in without a token.
  std::optional<access::AccessRole> invited;  ///< Print a link that lets one browser in.
  bool is_fused_only = false;                 ///< Viewers get no raw layers.
  std::optional<std::filesystem::path> web;
  unsigned thread_count = 0;     ///< Of the worker pool; 0 = as many as processors.
  bool has_config_file = false;  ///< They come from one, in part at least.
  files::ReadOptions read;
};

struct FuseOptions {
  std::filesystem::path input;
  std::filesystem::path output;
  std::optional<std::filesystem::path> thermal;
  session::SettingsText settings;
  files::ReadOptions read;
  protocol::codec::DracoKeeping keeping = protocol::codec::DracoKeeping::Shape;  ///< In a Draco file.
};

struct InfoOptions {
  std::filesystem::path input;
  std::optional<std::filesystem::path> thermal;
  bool as_json = false;
  files::ReadOptions read;
};

struct DemoSceneFileOptions {
  std::filesystem::path output;
  std::uint64_t vertex_count = 300'000;
  std::uint64_t seed = 1;
};

struct TradeoffCommandOptions {
  std::filesystem::path input;
  std::filesystem::path folder;  ///< For the tables and the report; made when it does not exist.
  std::optional<std::filesystem::path> thermal;
  std::string palette;  ///< From whose colours the temperature is read back; empty: the default.
  files::ReadOptions read;
};

struct StoreSalvageOptions {
  std::filesystem::path store;
  std::filesystem::path output;  ///< Must not be there yet.
};

struct TokenOptions {
  std::filesystem::path file;
  std::string role = "operator";
  std::string name;     ///< Empty: of the role.
  std::string removed;  ///< The name of one to take out.
  bool is_list = false;
};

struct PushOptions {
  std::filesystem::path input;  ///< A PLY file, or a folder of them.
  std::string to;               ///< The server's address, http://HOST:PORT.
  std::string id;               ///< Of the block of one file; empty: its name.
  std::optional<double> blocks_per_s;
  std::optional<std::filesystem::path> trusted;     ///< PEM; absent: whom this machine trusts.
  std::optional<std::filesystem::path> token_file;  ///< Holds a token in its first line; absent: the environment's.
  std::string observed_at = "file";                 ///< "file", "now" or Unix seconds.
  files::ReadOptions read;
};

struct CertificateOptions {
  std::filesystem::path certificate;  ///< Files to write.
  std::filesystem::path key;
  std::vector<std::string> names;  ///< Empty: the names and addresses of this machine.
  int days = 365;
  bool replaces = false;  ///< Files that are there.
};

struct MapOptions {
  std::filesystem::path frames;  ///< A folder of them.
  std::filesystem::path output;  ///< The mesh; empty: none.
  std::string to;                ///< A server to send it to while it grows; empty: none.
  std::optional<std::filesystem::path> token_file;
  std::optional<std::filesystem::path> poses;  ///< Absent: the folder's.
  std::optional<std::filesystem::path>
      corrected_poses;  ///< Of the same drive, known later: submaps move to them in the end.
  bool is_tracking =
      false;  ///< Poses are found from the frames; only that nearest to the first depth picture is taken as given.
  std::optional<std::filesystem::path> found_poses;  ///< Where to write the poses that were found.
  std::optional<std::filesystem::path> vignetting;
  double voxel_m = 0.01;
  unsigned thread_count = 0;
};

struct CalibrateOptions {
  std::filesystem::path frames;  ///< A folder of them.
  std::filesystem::path output;  ///< Of vignetting: the picture.
  double within_s = 0.5;         ///< Of thermal-delay: how far from what calibration.json says it is looked for.
  double voxel_m = 0.03;
  unsigned thread_count = 0;
};

struct DemoFramesOptions {
  std::filesystem::path folder;  ///< Made when it does not exist.
  double seconds = 60;
  std::uint64_t seed = 1;
  double pose_drift_m = 0;
  double clock_offset_s = 0;
};

/// Each runs one command to its end and returns an exit status; what went wrong stands on standard error in one line.
int run_serve(const ServeOptions& options);
/// Says whether `run_serve` could begin with them; they come from `file`.
int run_check_config(const std::filesystem::path& file, const ServeOptions& options);
/// Prints a page on what this machine can do and what would keep `run_serve` from working; `read` are the options in `file`, or why they cannot
/// be read.
int run_doctor(const std::optional<std::filesystem::path>& file, const std::variant<ServeOptions, std::string>& read);
int run_token(const TokenOptions& options);
int run_certificate(const CertificateOptions& options);
int run_fuse(const FuseOptions& options);
int run_info(const InfoOptions& options);
int run_methods(bool as_json);
int run_demo_scene(const DemoSceneFileOptions& options);
int run_tradeoff(const TradeoffCommandOptions& options);
int run_push(const PushOptions& options);
int run_map(const MapOptions& options);
int run_calibrate_delay(const CalibrateOptions& options);
int run_calibrate_vignetting(const CalibrateOptions& options);
int run_demo_frames(const DemoFramesOptions& options);
int run_store_check(const std::filesystem::path& store);
int run_store_salvage(const StoreSalvageOptions& options);

/// Parses the arguments, runs the command, returns the exit status. Catches everything.
int run_program(int argc, const char* const* argv);

}  // namespace spectra::app
