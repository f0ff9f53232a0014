#include <fmt/chrono.h>
#include <fmt/format.h>

#include <boost/asio/ip/host_name.hpp>
#include <chrono>
#include <filesystem>
#include <variant>

#include "server/access/certificate.hpp"
#include "server/access/private_file.hpp"
#include "server/app/command_output.hpp"
#include "server/app/commands.hpp"
#include "server/net/interface_addresses.hpp"

namespace spectra::app {
namespace {

/// What this machine is called by others.
std::vector<std::string> own_names() {
  std::vector<std::string> names;
  boost::system::error_code error;
  const std::string host = boost::asio::ip::host_name(error);
  if (!error && !host.empty() && host != "localhost") {
    names.push_back(host);
    if (host.find('.') == std::string::npos) names.push_back(host + ".local");
  }
  names.emplace_back("localhost");
  for (const auto& address : net::interface_addresses(true)) names.push_back(address.to_string());
  return names;
}

}  // namespace

int run_certificate(const CertificateOptions& options) {
  for (const auto& file : {options.certificate, options.key}) {
    std::error_code error;
    if (!options.replaces && std::filesystem::exists(file, error)) {
      return fail(kJobFailed, file.string() + " is there already; --replace writes over it");
    }
  }
  const auto now = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
  const auto made = access::make_certificate(options.names.empty() ? own_names() : options.names, now,
                                             std::chrono::days(options.days));
  if (const auto* problem = std::get_if<std::string>(&made)) return fail(kWrongUsage, "--name: " + *problem);
  const auto& pair = std::get<access::SelfMadeCertificate>(made);
  // The key first: a server that reads both in between finds that they do not fit, and goes on with the old ones.
  if (const auto problem = access::write_private_file(options.key, pair.key)) return fail(kJobFailed, *problem);
  if (const auto problem = access::write_private_file(options.certificate, pair.certificate))
    return fail(kJobFailed, *problem);
  const auto facts = std::get<access::CertificateFacts>(access::certificate_facts(pair.certificate));
  fmt::print("{}\n", facts.fingerprint);
  fmt::print(stderr, "SHA-256 fingerprint of {}, good until {:%Y-%m-%d} for {}; its key is in {}\n",
             options.certificate.string(), fmt::gmtime(std::chrono::system_clock::to_time_t(facts.not_after)),
             fmt::join(facts.names, ", "), options.key.string());
  return kDone;
}

}  // namespace spectra::app
