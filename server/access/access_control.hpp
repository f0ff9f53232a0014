#pragma once

#include <chrono>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/access/address_rates.hpp"
#include "server/access/role.hpp"
#include "server/access/token_bucket.hpp"
#include "server/access/token_file.hpp"

namespace spectra::access {

/// Lets each address try so often, and all of them together. Not thread-safe.
class AttemptLimit {
 public:
  bool take(const std::string& address, double now_s);

  static constexpr double kPerSecond = 0.5;
  static constexpr double kBurst = 8;
  static constexpr double kPerSecondOfAll = 20;
  static constexpr double kBurstOfAll = 100;

 private:
  AddressRates by_address_{kPerSecond, kBurst};
  TokenBucket all_{kPerSecondOfAll, kBurstOfAll};
};

/// Who asks, and whether he may. Thread-safe.
class AccessControl {
 public:
  using Clock = std::function<std::chrono::sys_seconds()>;

  /// Who somebody turned out to be.
  struct Identity {
    AccessRole role = AccessRole::Viewer;
    std::string name;  ///< Of the token; empty where none is needed.
    bool is_by_cookie = false;
  };
  enum class Refusal {
    None,     ///< No token, cookie or code was shown.
    Wrong,    ///< What was shown is not known, or not any more.
    TooMany,  ///< Wrong ones came too often; nothing was looked at.
  };
  struct Outcome {
    std::optional<Identity> identity;
    Refusal refusal = Refusal::None;
  };
  struct Login {
    Outcome outcome;
    std::string set_cookie;  ///< For the header; of a login that succeeded.
  };

  /// Nobody needs a token; the map is changed, and others are let in, from this machine alone.
  AccessControl() = default;
  /// `cookie_name` tells servers of one host apart. `now` is the system's clock where it is empty.
  AccessControl(TokenList list, std::string cookie_name, Clock now = {});

  /// Another list, from now on; codes that are out stay good where who made them is still there.
  void replace(TokenList list);
  bool needs_token() const;
  /// Of the first token: in whose name the program itself lets others in. Empty where nobody needs one.
  std::string first_name() const;

  /// From the values of Authorization and Cookie; `is_from_here` where the peer is on this machine.
  Outcome identify(std::string_view authorization, std::string_view cookies, const std::string& address,
                   bool is_from_here, double now_s);
  /// With what a person typed or was sent: a token or a code.
  Login login(std::string_view text, const std::string& address, bool is_secure, double now_s);
  /// Whether the token is still there that somebody was let in with.
  bool is_good(const Identity& identity) const;
  /// What makes a browser forget.
  std::string forgetting_cookie() const;

  /// A code that lets one browser in, once, within kCodeLifetime. Nothing when `role` may do what its maker may not.
  std::optional<std::string> make_code(const Identity& maker, AccessRole role);

  static constexpr std::chrono::minutes kCodeLifetime{15};
  static constexpr std::chrono::hours kCookieLifetime{24 * 7};
  static constexpr std::size_t kMostCodes = 64;

 private:
  struct Code {
    Digest digest{};
    AccessRole role = AccessRole::Viewer;
    std::string name;  ///< Of the token that it was made with.
    std::chrono::sys_seconds until;
  };

  const AccessToken* token_of(std::string_view text) const;
  const AccessToken* token_named(std::string_view name) const;
  std::optional<Identity> of_cookie(std::string_view value) const;
  std::optional<Identity> of_code(std::string_view text);
  /// A cookie is good as long as the token that it came from is there, with its role.
  std::string key_of(const AccessToken& token) const;
  std::string cookie_value(const Identity& identity) const;

  mutable std::mutex mutex_;
  std::optional<TokenList> list_;
  std::string cookie_name_;
  Clock now_;
  std::vector<Code> codes_;
  AttemptLimit attempts_;
};

}  // namespace spectra::access
