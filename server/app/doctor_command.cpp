#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <variant>

#include "server/access/certificate.hpp"
#include "server/app/commands.hpp"
#include "server/app/serve_setup.hpp"
#include "server/net/tls_identity.hpp"
#include "server/store/store_file.hpp"

namespace spectra::app {
namespace fs = std::filesystem;
using boost::asio::ip::tcp;
using std::chrono::system_clock;

namespace {

constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;
constexpr std::uint64_t kLittleBytes = 1024 * kMiB;  ///< Of memory or disk.
constexpr std::chrono::days kSoon{30};
constexpr int kSecondsToAnswer = 2;
/// No clock that is right shows an earlier time.
constexpr std::chrono::sys_days kEarliest{std::chrono::year{2026} / 1 / 1};

/// The page, line by line.
class Report {
 public:
  void ok(const std::string& text) { line("ok", text); }
  void note(const std::string& text) { line("note", text); }
  void wrong(const std::string& text) {
    line("wrong", text);
    is_wrong_ = true;
  }
  bool is_wrong() const { return is_wrong_; }

 private:
  static void line(const char* kind, const std::string& text) { std::printf("%-6s %s\n", kind, text.c_str()); }
  bool is_wrong_ = false;
};

std::uint64_t available_memory() {
  std::ifstream in("/proc/meminfo");
  for (std::string name, unit; in >> name;) {
    std::uint64_t kib = 0;
    in >> kib;
    std::getline(in, unit);
    if (name == "MemAvailable:") return kib * 1024;
  }
  return 0;
}

void look_at_machine(Report& report, const ServeOptions& options) {
  const unsigned processors = std::thread::hardware_concurrency();
  if (processors > 1) {
    report.ok(fmt::format("processors: {}", processors));
  } else {
    report.note("processors: 1; pictures come later while the map changes");
  }
  const auto total =
      static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
  const std::uint64_t available = available_memory();
  const std::string memory = fmt::format("memory: {} MiB of {} MiB available", available / kMiB, total / kMiB);
  if (available >= kLittleBytes) {
    report.ok(memory);
  } else {
    report.note(memory + "; that is little for a large map: end other programs, or serve a smaller one");
  }
  rlimit limit{};
  getrlimit(RLIMIT_NOFILE, &limit);
  const std::size_t wanted = options.limits.max_connections;
  if (limit.rlim_max > wanted) {
    report.ok(fmt::format("descriptors: {}", limit.rlim_max));
  } else {
    report.note(
        fmt::format("descriptors: {}, one for each viewer; {} would be used: ulimit -n, or LimitNOFILE of the service",
                    limit.rlim_max, wanted));
  }
}

void look_at_clock(Report& report) {
  const auto now = system_clock::now();
  const std::string text = fmt::format("clock: {:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(system_clock::to_time_t(now)));
  if (now >= kEarliest) {
    report.ok(text);
  } else {
    report.note(text + " is long ago: times of the map and certificates go wrong; set it (timedatectl)");
  }
}

/// Whether it is Spectra that answers there.
bool answers_as_spectra(const tcp::endpoint& endpoint) {
  boost::system::error_code error;
  boost::asio::io_context context;
  tcp::socket socket(context);
  auto address = endpoint.address();
  if (address.is_unspecified()) {
    address = address.is_v6() ? boost::asio::ip::address(boost::asio::ip::address_v6::loopback())
                              : boost::asio::ip::address(boost::asio::ip::address_v4::loopback());
  }
  socket.connect({address, endpoint.port()}, error);
  if (error) return false;
  const timeval patience{kSecondsToAnswer, 0};
  setsockopt(socket.native_handle(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  boost::asio::write(
      socket, boost::asio::buffer(std::string("GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")),
      error);
  // Read by the system's own call: Asio's would wait again when the time is over.
  std::string answer(512, '\0');
  const auto size = ::recv(socket.native_handle(), answer.data(), answer.size(), 0);
  answer.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
  return answer.find("\r\nServer: Spectra") != std::string::npos;
}

void look_at_address(Report& report, const ServeOptions& options, bool has_tokens) {
  const auto listen = net::parsed_listen_address(options.listen);
  if (!listen) {
    report.wrong("address: " + options.listen + " is none; ADDRESS:PORT is wanted, such as 0.0.0.0:8080");
    return;
  }
  boost::system::error_code error;
  boost::asio::io_context context;
  tcp::acceptor acceptor(context);
  const tcp::endpoint endpoint(boost::asio::ip::make_address(listen->address, error), listen->port);
  if (!error) acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(1, error);
  const std::string place = "address: " + options.listen;
  namespace errc = boost::system::errc;
  if (!error) {
    report.ok(place + " is free");
  } else if (error == errc::address_in_use && answers_as_spectra(endpoint)) {
    report.note(place + " is taken by Spectra itself, which answers there");
  } else if (error == errc::address_in_use) {
    report.wrong(
        fmt::format("{} is taken by another program: ss -ltnp 'sport = {}' names it; end it or listen elsewhere", place,
                    listen->port));
  } else if (error == errc::permission_denied) {
    report.wrong(place + " is not for this user: take a port from 1024 on, and a reverse proxy in front");
  } else if (error == errc::address_not_available) {
    report.wrong(place + " is no address of this machine: ip address shows those it has");
  } else {
    report.wrong(place + ": " + error.message());
  }
  if (is_open_to_strangers(options, *listen, has_tokens)) {
    report.wrong("access: others reach " + options.listen +
                 ", and there are no tokens: spectra token --file FILE makes one, for tokens = \"FILE\"");
  } else if (!net::is_loopback(*listen) && !has_tokens) {
    report.note("access: anybody on the network may watch and operate (insecure)");
  } else if (!net::is_loopback(*listen) && !options.certificate) {
    report.note(
        "access: tokens and pictures go over the network in the clear; spectra certificate makes what encrypts them");
  }
}

/// Whether anybody needs a token.
bool look_at_tokens(Report& report, const ServeOptions& options) {
  const auto read = token_list(options);
  if (const auto* problem = std::get_if<std::string>(&read)) {
    report.wrong("tokens: " + *problem);
    return true;
  }
  const auto& list = std::get<std::optional<access::TokenList>>(read);
  if (!list) {
    report.ok("tokens: none asked for");
  } else if (list->tokens.empty()) {
    report.wrong("tokens: there are none, so nobody is let in: spectra token --file FILE makes one");
  } else {
    report.ok(fmt::format("tokens: {}", list->tokens.size()));
  }
  return list.has_value();
}

void look_at_certificate(Report& report, const ServeOptions& options) {
  if (!options.certificate) return;
  const std::string file = "certificate: " + options.certificate->string();
  if (const auto problem = net::TlsIdentity(*options.certificate, *options.key).load()) {
    report.wrong("certificate: " + *problem);
    return;
  }
  std::ifstream in(*options.certificate);
  const auto read = access::certificate_facts({std::istreambuf_iterator<char>(in), {}});
  if (const auto* problem = std::get_if<std::string>(&read)) {
    report.wrong(file + ": " + *problem);
    return;
  }
  const auto& facts = std::get<access::CertificateFacts>(read);
  const auto day = [](std::chrono::sys_seconds time) {
    return fmt::format("{:%Y-%m-%d}", fmt::gmtime(system_clock::to_time_t(time)));
  };
  const auto now = system_clock::now();
  const std::string again = "; spectra certificate --replace makes another, systemctl reload takes it";
  if (now < facts.not_before) {
    report.wrong(file + " is good from " + day(facts.not_before) + " on only; is the clock right?");
  } else if (now > facts.not_after) {
    report.wrong(file + " was good until " + day(facts.not_after) + again);
  } else if (now + kSoon > facts.not_after) {
    report.note(file + " is good until " + day(facts.not_after) + " only" + again);
  } else {
    report.ok(fmt::format("{} is good until {} for {}, and the key is its own", file, day(facts.not_after),
                          fmt::join(facts.names, ", ")));
  }
}

void look_at_store(Report& report, const ServeOptions& options) {
  if (!options.store) return;
  const std::string file = "store: " + options.store->string();
  if (const auto problem = store_problem(options)) {
    report.wrong("store: " + *problem);
    return;
  }
  const fs::path folder = options.store->has_parent_path() ? options.store->parent_path() : fs::path(".");
  if (::access(folder.c_str(), W_OK) != 0) {
    report.wrong(file + ": this user may not write into " + folder.string() + "; ask as the user who serves");
  }
  std::error_code error;
  const auto space = fs::space(folder, error);
  if (!error && space.available < kLittleBytes) {
    report.note(fmt::format("{}: {} MiB are free on its disk; make room, or keep less (history)", file,
                            space.available / kMiB));
  }
  if (!fs::exists(*options.store, error)) {
    report.ok(file + " will be made");
    return;
  }
  auto opened = store::StoreFile::open(options.store->string(), {.is_read_only = true});
  if (!opened) {
    if (opened.error().code == store::StoreErrorCode::Locked) {
      report.note(file + " is in use, so it was not looked into");
    } else {
      report.wrong("store: " + opened.error().message);
    }
    return;
  }
  const store::Catalogue catalogue = opened.value()->take_catalogue();
  const auto faults = opened.value()->check(catalogue, [](double) {});
  if (!faults) {
    report.wrong("store: " + faults.error().message);
  } else if (!faults.value().empty()) {
    report.wrong(fmt::format("{} is damaged ({}): spectra store salvage {} NEW rescues what can be read", file,
                             faults.value().front(), options.store->string()));
  } else {
    report.ok(fmt::format("{} is whole: {} blocks", file, catalogue.block_count()));
  }
}

void look_at_web(Report& report, const ServeOptions& options) {
  const fs::path folder = web_root(options);
  std::error_code error;
  if (!fs::exists(folder / "index.html", error)) {
    report.wrong("web client: there is no index.html in " + folder.lexically_normal().string() +
                 "; install the package again, or build it (deploy/build_web.sh)");
  } else {
    report.ok("web client: " + folder.lexically_normal().string());
  }
}

}  // namespace

int run_doctor(const std::optional<fs::path>& file, const std::variant<ServeOptions, std::string>& read) {
  Report report;
  ServeOptions options;
  if (const auto* problem = std::get_if<std::string>(&read)) {
    report.wrong("config: " + *problem);
  } else {
    options = std::get<ServeOptions>(read);
    report.ok(file ? "config: " + file->string()
                   : std::string("config: none named, so what serve does without options is looked at"));
  }
  look_at_machine(report, options);
  look_at_clock(report);
  if (std::holds_alternative<ServeOptions>(read)) {
    const bool has_tokens = look_at_tokens(report, options);
    look_at_address(report, options, has_tokens);
    look_at_certificate(report, options);
    if (const auto problem = scene_problem(options)) report.wrong("scene: " + *problem);
    look_at_store(report, options);
    look_at_web(report, options);
  }
  report.note(
      "browsers: a viewer whose browser draws without a GPU sees fewer pictures a second; chrome://gpu or "
      "about:support there "
      "should say that WebGL is hardware accelerated");
  return report.is_wrong() ? kJobFailed : kDone;
}

}  // namespace spectra::app
