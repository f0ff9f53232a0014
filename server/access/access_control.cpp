#include "server/access/access_control.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

namespace spectra::access {
namespace {

constexpr std::string_view kBearer = "Bearer ";
constexpr std::size_t kCodeLength = 8;
/// Longer ones are looked at by nobody.
constexpr std::size_t kLongestSecret = 512;

std::chrono::sys_seconds system_now() {
  return std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
}

/// What is signed. The parts hold no dots.
std::string claim_of(AccessRole role, std::chrono::sys_seconds until, std::string_view name) {
  return std::string(to_string(role)) + '.' + std::to_string(until.time_since_epoch().count()) + '.' +
         std::string(name);
}

/// The value of a cookie, of all that a browser sends.
std::optional<std::string_view> cookie_of(std::string_view cookies, std::string_view name) {
  while (!cookies.empty()) {
    const std::size_t end = std::min(cookies.find(';'), cookies.size());
    std::string_view pair = cookies.substr(0, end);
    cookies.remove_prefix(std::min(end + 1, cookies.size()));
    while (!pair.empty() && pair.front() == ' ') pair.remove_prefix(1);
    const std::size_t equals = pair.find('=');
    if (equals != std::string_view::npos && pair.substr(0, equals) == name) return pair.substr(equals + 1);
  }
  return std::nullopt;
}

/// As people type codes.
std::string tidy_code(std::string_view text) {
  std::string tidy;
  for (const char c : text) {
    if (c == '-' || c == ' ') continue;
    tidy += c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  }
  return tidy;
}

}  // namespace

bool AttemptLimit::take(const std::string& address, double now_s) {
  return by_address_.of(address).take(now_s) && all_.take(now_s);
}

AccessControl::AccessControl(TokenList list, std::string cookie_name, Clock now)
    : list_(std::move(list)), cookie_name_(std::move(cookie_name)), now_(now ? std::move(now) : Clock(system_now)) {}

void AccessControl::replace(TokenList list) {
  const std::lock_guard lock(mutex_);
  list_ = std::move(list);
}

bool AccessControl::needs_token() const {
  const std::lock_guard lock(mutex_);
  return list_.has_value();
}

std::string AccessControl::first_name() const {
  const std::lock_guard lock(mutex_);
  return list_ ? list_->tokens.front().name : "";
}

const AccessToken* AccessControl::token_of(std::string_view text) const {
  const Digest digest = digest_of(text);
  const AccessToken* found = nullptr;
  for (const AccessToken& token : list_->tokens) {
    if (is_same(token.digest, digest)) found = &token;
  }
  return found;
}

const AccessToken* AccessControl::token_named(std::string_view name) const {
  const auto found = std::find_if(list_->tokens.begin(), list_->tokens.end(),
                                  [name](const AccessToken& token) { return token.name == name; });
  return found == list_->tokens.end() ? nullptr : &*found;
}

std::string AccessControl::key_of(const AccessToken& token) const {
  return list_->secret + ' ' + std::string(to_string(token.role)) + ' ' + to_hex(token.digest);
}

AccessControl::Outcome AccessControl::identify(std::string_view authorization, std::string_view cookies,
                                               const std::string& address, bool is_from_here, double now_s) {
  const std::lock_guard lock(mutex_);
  if (!list_) return {Identity{is_from_here ? AccessRole::Admin : AccessRole::Operator, "", false}, Refusal::None};
  if (!authorization.empty()) {
    const bool is_bearer = authorization.size() > kBearer.size() && authorization.size() < kLongestSecret &&
                           std::equal(kBearer.begin(), kBearer.end(), authorization.begin(),
                                      [](char a, char b) { return (a | 32) == (b | 32); });
    const AccessToken* token = is_bearer ? token_of(authorization.substr(kBearer.size())) : nullptr;
    if (token != nullptr) return {Identity{token->role, token->name, false}, Refusal::None};
    return {std::nullopt, attempts_.take(address, now_s) ? Refusal::Wrong : Refusal::TooMany};
  }
  const auto cookie = cookie_of(cookies, cookie_name_);
  if (!cookie || cookie->empty()) return {};
  if (auto identity = of_cookie(*cookie)) return {std::move(identity), Refusal::None};
  return {std::nullopt, Refusal::Wrong};
}

AccessControl::Login AccessControl::login(std::string_view text, const std::string& address, bool is_secure,
                                          double now_s) {
  const std::lock_guard lock(mutex_);
  if (!list_) return {};
  if (!attempts_.take(address, now_s)) return {{std::nullopt, Refusal::TooMany}, ""};
  std::optional<Identity> identity;
  if (text.size() <= kLongestSecret) {
    if (const AccessToken* token = token_of(text)) identity = Identity{token->role, token->name, true};
    if (!identity) identity = of_code(text);
  }
  if (!identity) return {{std::nullopt, Refusal::Wrong}, ""};
  std::string cookie = cookie_name_ + '=' + cookie_value(*identity) + "; Path=/; HttpOnly; SameSite=Strict; Max-Age=" +
                       std::to_string(std::chrono::seconds(kCookieLifetime).count());
  if (is_secure) cookie += "; Secure";
  return {{std::move(identity), Refusal::None}, std::move(cookie)};
}

bool AccessControl::is_good(const Identity& identity) const {
  const std::lock_guard lock(mutex_);
  return !list_ || token_named(identity.name) != nullptr;
}

std::string AccessControl::forgetting_cookie() const {
  const std::lock_guard lock(mutex_);
  return cookie_name_ + "=; Path=/; HttpOnly; SameSite=Strict; Max-Age=0";
}

std::string AccessControl::cookie_value(const Identity& identity) const {
  const std::string claim = claim_of(identity.role, now_() + kCookieLifetime, identity.name);
  return claim + '.' + to_hex(signature_of(claim, key_of(*token_named(identity.name))));
}

std::optional<AccessControl::Identity> AccessControl::of_cookie(std::string_view value) const {
  std::array<std::string_view, 4> parts;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const std::size_t dot = value.find('.');
    if ((dot == std::string_view::npos) != (i + 1 == parts.size())) return std::nullopt;
    parts[i] = value.substr(0, dot);
    if (dot != std::string_view::npos) value.remove_prefix(dot + 1);
  }
  const auto role = access_role(parts[0]);
  std::int64_t until_s = 0;
  const auto [end, error] = std::from_chars(parts[1].data(), parts[1].data() + parts[1].size(), until_s);
  Digest signature{};
  if (!role || error != std::errc() || end != parts[1].data() + parts[1].size() || !from_hex(parts[3], signature)) {
    return std::nullopt;
  }
  const std::chrono::sys_seconds until{std::chrono::seconds(until_s)};
  const AccessToken* token = token_named(parts[2]);
  if (token == nullptr) return std::nullopt;
  if (!is_same(signature, signature_of(claim_of(*role, until, parts[2]), key_of(*token)))) return std::nullopt;
  if (until <= now_()) return std::nullopt;
  return Identity{*role, token->name, true};
}

std::optional<std::string> AccessControl::make_code(const Identity& maker, AccessRole role) {
  if (!may(maker.role, Right::Administer) && !(maker.role == AccessRole::Operator && role == AccessRole::Viewer)) {
    return std::nullopt;
  }
  const std::lock_guard lock(mutex_);
  if (!list_) return std::nullopt;
  const auto now = now_();
  std::erase_if(codes_, [now](const Code& code) { return code.until <= now; });
  if (codes_.size() >= kMostCodes) codes_.erase(codes_.begin());
  const std::string code = random_code(kCodeLength);
  codes_.push_back({digest_of(code), role, maker.name, now + kCodeLifetime});
  return code.substr(0, kCodeLength / 2) + '-' + code.substr(kCodeLength / 2);
}

std::optional<AccessControl::Identity> AccessControl::of_code(std::string_view text) {
  const Digest digest = digest_of(tidy_code(text));
  const auto now = now_();
  auto found = codes_.end();
  for (auto code = codes_.begin(); code != codes_.end(); ++code) {
    if (is_same(code->digest, digest)) found = code;
  }
  if (found == codes_.end()) return std::nullopt;
  const Code code = *found;
  codes_.erase(found);
  if (code.until <= now || token_named(code.name) == nullptr) return std::nullopt;
  return Identity{code.role, code.name, true};
}

}  // namespace spectra::access
