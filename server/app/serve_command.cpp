#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <stdexcept>
#include <thread>

#include "fusion/demo/demo_scene.hpp"
#include "server/access/access_control.hpp"
#include "server/api/http_api.hpp"
#include "server/app/command_output.hpp"
#include "server/app/commands.hpp"
#include "server/app/invitation.hpp"
#include "server/app/log_setup.hpp"
#include "server/app/progress_line.hpp"
#include "server/app/serve_setup.hpp"
#include "server/net/http_server.hpp"
#include "server/net/memory_reserve.hpp"
#include "server/net/tls_identity.hpp"
#include "server/session/served_scene.hpp"
#include "server/session/viewer_session.hpp"
#include "server/sources/live_feed.hpp"
#include "server/sources/map_feed.hpp"
#include "server/sources/map_keeper.hpp"
#include "server/stream/first_picture.hpp"

namespace spectra::app {
namespace fs = std::filesystem;
namespace {

/// From the last connection to the end of the program.
constexpr std::chrono::milliseconds kLongestEnd{250};
/// In the place of a folder: a robot sends the frames.
constexpr std::string_view kLiveFrames = "live";

/// Every viewer needs a descriptor, and the usual limit of 1024 is only a default.
void set_descriptor_limit(std::size_t wanted) {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = std::min<rlim_t>(wanted, limit.rlim_max);
  setrlimit(RLIMIT_NOFILE, &limit);
}

/// Reads the file again; what is wrong with it is said, and nothing changes.
void reload_tokens(const std::filesystem::path& file, access::AccessControl& access) {
  auto read = access::read_tokens(file);
  if (const auto* problem = std::get_if<std::string>(&read)) {
    spdlog::error("the tokens stay as they were: {}", *problem);
    return;
  }
  auto& list = std::get<access::TokenList>(read);
  spdlog::info("the tokens are read again: {}", list.tokens.size());
  access.replace(std::move(list));
}

/// The certificate and key are read again; what is wrong with them is said, and nothing changes.
void reload_certificate(net::TlsIdentity& tls) {
  if (const auto problem = tls.load()) {
    spdlog::error("the certificate stays as it was: {}", *problem);
  } else {
    spdlog::info("the certificate is read again");
  }
}

void print_invitation(const net::HttpServer& server, access::AccessControl& access, access::AccessRole role) {
  const auto code = access.make_code({access::AccessRole::Admin, access.first_name(), false}, role);
  if (!code) return;
  const std::string link = server.urls().back() + "/login#" + *code;
  std::printf("for one %s, within %d minutes: %s\n%s", std::string(to_string(role)).c_str(),
              static_cast<int>(access::AccessControl::kCodeLifetime.count()), link.c_str(), qr_text(link).c_str());
}

/// Whether a scene is beyond the limit, in words.
std::optional<std::string> size_problem(const mesh::MultispectralMesh& mesh, std::uint64_t most_bytes) {
  const std::uint64_t bytes = sources::MapKeeper::bytes_of(mesh.vertex_count(), mesh.triangle_count());
  if (bytes <= most_bytes) return std::nullopt;
  return "the scene would take about " + std::to_string(bytes) + " bytes of memory, and " + std::to_string(most_bytes) +
         " are allowed; serve a smaller one, or with another --limit scene-bytes";
}

/// Reads and tiles the scene in a thread of its own, while the server already answers.
class SceneLoader {
 public:
  SceneLoader(const ServeOptions& options, session::ServedScene& served, sources::MapKeeper& map,
              net::HttpServer& server)
      : thread_([this, &options, &served, &map, &server] {
          try {
            if (options.is_live || options.store || options.frames || options.is_demo_drive) {
              served.progress.set("Reading the map");
              if (const auto problem = map.restore()) throw std::runtime_error(*problem);
              served.progress.set(std::nullopt);
              const auto scene = served.scenes.current();
              spdlog::info("serving the {}: {} vertices, {} triangles", scene->name(), scene->vertex_count(),
                           scene->triangle_count());
            } else {
              load(options, served);
              map.open_with_file();
            }
          } catch (const std::exception& error) {
            failure_ = error.what();
          }
          is_done_ = true;
          if (!failure_.empty()) server.stop();
        }) {}

  bool is_done() const { return is_done_; }

  /// Why there is no scene; empty when there is. Waits for the end.
  const std::string& failure() {
    if (thread_.joinable()) thread_.join();
    return failure_;
  }

 private:
  static void load(const ServeOptions& options, session::ServedScene& served) {
    const std::string name = options.scene ? options.scene->filename().string() : "the demo scene";
    served.progress.set("Reading " + name);
    files::LoadedScene loaded;
    std::vector<ProgressStage> tiling{{map::kTilingPhase, "cutting " + name + " into tiles", 10}};
    ProgressLine line(options.scene
                          ? with_loading(*options.scene, options.thermal, tiling)
                          : std::vector<ProgressStage>{{base::kModellingPhase, "modelling " + name, 10}, tiling[0]});
    if (options.scene) {
      auto read = load_scene(*options.scene, options.thermal, watched(options.read, line));
      if (!read) throw std::runtime_error(read.error().message);
      loaded = std::move(read).value();
    } else {
      loaded.mesh = demo::demo_scene({}, line.sink());
    }
    if (const auto problem = size_problem(loaded.mesh, options.limits.scene_bytes)) throw std::runtime_error(*problem);
    print_notes(loaded.notes);
    served.progress.set("Cutting " + name + " into tiles (" + std::to_string(loaded.mesh.vertex_count()) +
                        " vertices)");
    const auto scene = served.scenes.replace(
        std::move(loaded), served.pool, map::LevelsOfDetail::All,
        [&served](const auto& next) { stream::encode_first_picture(next, served.cache); }, line.sink());
    line.end();
    served.progress.set(std::nullopt);
    spdlog::info("serving {}: {} vertices, {} triangles, {} tiles", scene->name(), scene->vertex_count(),
                 scene->triangle_count(), scene->tiles().size());
  }

  std::atomic<bool> is_done_{false};
  std::string failure_;
  std::jthread thread_;  // Joined, too, when serving ends with an exception.
};

}  // namespace

int run_serve(const ServeOptions& options) {
  // Whoever read what it says may go; the server stays.
  std::signal(SIGPIPE, SIG_IGN);
  net::keep_memory_reserve();
  if (const auto problem = set_up_log(options.log)) return fail(kJobFailed, *problem);
  auto looked = serve_setup(options);
  if (const auto* problem = std::get_if<SetupProblem>(&looked)) return fail(problem->status, problem->text);
  auto& setup = std::get<ServeSetup>(looked);
  set_descriptor_limit(options.limits.descriptors);
  std::optional<sources::FrameStream> frames;
  const bool takes_frames = options.frames == kLiveFrames;
  if (options.frames && !takes_frames) {
    if (options.has_submaps)
      return fail(kWrongUsage, "--submaps goes with --map live; of a folder, see spectra map --corrected-poses");
    auto folder = mapping::FrameFolder::open(*options.frames, std::nullopt, !options.is_tracking);
    if (!folder) return fail(folder.error());
    frames = sources::stream_of(std::move(folder).value());
  } else if (options.is_demo_drive) {
    frames = sources::demo_drive_stream();
  }

  net::NetOptions net;
  if (setup.tokens) {
    net.access = std::make_shared<access::AccessControl>(std::move(*setup.tokens),
                                                         "spectra_" + std::to_string(setup.listen.port));
  }
  net.tls = setup.tls;
  // With a config file it is a service: nobody's terminal closes with SIGHUP.
  if (options.tokens || net.tls || options.has_config_file) {
    net.reload = [file = options.tokens, access = net.access, tls = net.tls] {
      if (file) reload_tokens(*file, *access);
      if (tls) reload_certificate(*tls);
      if (!file && !tls) spdlog::info("there are no tokens and no certificate to read again");
    };
  }
  net.address = setup.listen.address;
  net.port = setup.listen.port;
  net.allowed_hosts = options.allowed_hosts;
  net.limits = options.limits;
  net.limits.gives_raw_layers = !options.is_fused_only;
  net.stop_on_signals = true;
  const unsigned processors = std::max(1U, std::thread::hardware_concurrency());
  const auto served = std::make_unique<session::ServedScene>(
      options.thread_count > 0 ? options.thread_count : processors, options.limits.cache_bytes);
  std::unique_ptr<store::BlockStore> store;
  if (options.store) {
    store::StoreOptions keeping;
    keeping.history_bytes = options.history_bytes;
    keeping.is_read_only = options.at.has_value();
    auto opened = store::BlockStore::open(options.store->string(), keeping);
    if (!opened) return fail(kJobFailed, opened.error().message);
    store = std::move(opened).value();
  }
  sources::MapKeeper map(served->scenes, served->pool, std::move(store), options.at, options.limits.scene_bytes);
  map.on_store_trouble = [&served](std::optional<std::string> what) { served->store_trouble.set(std::move(what)); };
  served->mark_baseline = [&map](sources::BaselineDone done) { map.mark_baseline(std::move(done)); };
  api::HttpApi api(*served, map, options.limits);
  std::unique_ptr<net::HttpServer> server;
  try {
    server = std::make_unique<net::HttpServer>(
        net, [&api](const net::HttpRequest& request, const auto& reply) { api.handle(request, reply); },
        [&served, limits = net.limits](const std::shared_ptr<net::ViewerPeer>& peer) {
          return std::make_shared<session::ViewerSession>(peer, *served, limits);
        },
        web_root(options),
        [&api](net::BlockChange change, auto done) { api.change_block(std::move(change), std::move(done)); });
  } catch (const std::runtime_error& error) {
    return fail(kJobFailed, error.what());
  }
  api.set_metrics(server->metrics());
  for (const auto& url : server->urls()) std::printf("listening on %s\n", url.c_str());
  std::unique_ptr<sources::MapFeed> feed;
  if (options.invited) print_invitation(*server, *net.access, *options.invited);
  if (options.is_insecure && !net::is_loopback(setup.listen))
    spdlog::warn("anybody on the network may watch and operate (--insecure)");
  std::fflush(stdout);

  SceneLoader loader(options, *served, map, *server);
  mapping::MapperSettings mapping;
  mapping.voxel_m = options.voxel_m.value_or(options.is_demo_drive ? 0.02 : 0.01);
  mapping.most_bytes = options.limits.scene_bytes;
  mapping.is_tracking = options.is_tracking;
  if (options.has_submaps) mapping.submaps.emplace();
  const auto mapping_ended = [&served](const std::string& why) { served->mapping_trouble.set(why); };
  if (frames) {
    feed = std::make_unique<sources::MapFeed>(
        std::move(*frames), mapping, map, served->robot, [&loader] { return loader.is_done(); }, mapping_ended);
  }
  std::optional<sources::UnitHandOver> hand_over;
  std::unique_ptr<sources::LiveFeed> live;
  if (takes_frames) {
    hand_over.emplace(map, "");
    live = std::make_unique<sources::LiveFeed>(
        mapping,
        sources::LiveFeed::Sinks{
            std::ref(*hand_over),
            [&served](const sources::RobotPose& pose, bool is_last) { served->robot.moved(pose, is_last); },
            [&hand_over] { return hand_over->room(); }, mapping_ended},
        [&loader] { return loader.is_done(); });
    server->set_frame_receiver(*live);
  }
  server->run();
  if (!loader.is_done()) {
    // Reading cannot be interrupted, and nothing of it needs to be put in order.
    ProgressLine::make_way(true);
    spdlog::default_logger()->flush();
    std::_Exit(kDone);
  }
  // What is being computed cannot be interrupted, and need not be ended: a store survives more than that.
  // The program's own hold on the log may end meanwhile.
  std::thread([log = spdlog::default_logger()] {
    std::this_thread::sleep_for(kLongestEnd);
    log->flush();
    std::_Exit(kDone);
  }).detach();
  feed.reset();
  if (hand_over) hand_over->end();
  live.reset();
  // Whoever still answers does so to a server that is there.
  map.end();
  served->pool.stop();
  return loader.failure().empty() ? kDone : fail(kJobFailed, loader.failure());
}

}  // namespace spectra::app
