#include "server/net/sender_session.hpp"

#include <spdlog/spdlog.h>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <exception>
#include <utility>

#include "server/net/request_right.hpp"
#include "server/net/websocket_setup.hpp"

namespace spectra::net {
namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = boost::beast::websocket;
using boost::system::error_code;

SenderSession::SenderSession(Transport stream, ServerContext& context, access::AccessControl::Identity who, Kind kind)
    : ws_(std::move(stream)),
      context_(context),
      who_(std::move(who)),
      kind_(kind),
      writer_signal_(ws_.get_executor(), asio::steady_timer::time_point::max()),
      minder_timer_(ws_.get_executor()),
      reader_timer_(ws_.get_executor()) {}

/// Held by each of a session's coroutines: one that is lost for lack of memory ends the session, whose receiver waits for another sender then.
class SenderSession::Part {
 public:
  explicit Part(SenderSession& session) : session_(session.shared_from_this()) {}
  ~Part() {
    if (is_done_) return;
    try {
      session_->end(true, "there is no memory for it");
    } catch (const std::exception& error) {
      spdlog::error("the connection of {} could not be closed: {}", session_->kind_.name, error.what());
    }
  }
  Part(const Part&) = delete;
  Part& operator=(const Part&) = delete;
  void done() { is_done_ = true; }

 private:
  const std::shared_ptr<SenderSession> session_;
  bool is_done_ = false;
};

asio::awaitable<void> SenderSession::whole(asio::awaitable<void> work) {
  Part part(*this);
  co_await std::move(work);
  part.done();
}

asio::awaitable<void> SenderSession::run(UpgradeRequest request) {
  using namespace asio::experimental::awaitable_operators;
  const auto self = shared_from_this();
  Part part(*this);
  try {
    beast::get_lowest_layer(ws_).expires_never();
    set_up_websocket(ws_, context_.options.limits.header_timeout, std::string(kind_.subprotocol),
                     kind_.largest_message);
    ws_.control_callback([this](websocket::frame_type kind, beast::string_view payload) {
      control_received(kind, {payload.data(), payload.size()});
    });
    const auto [accept_error] = co_await ws_.async_accept(request, kAwait);
    const Registration registration(context_, self);
    if (accept_error || !registration.is_taken()) {
      end(false, "the upgrade was not finished");
      part.done();
      co_return;
    }
    spdlog::info("{} has come", kind_.name);
    co_await (whole(read_messages()) && whole(write_answers()) && whole(mind_deadlines()));
  } catch (const std::exception& error) {
    spdlog::error("the session of {} failed: {}", kind_.name, error.what());
  }
  end(false, "");
  part.done();
}

void SenderSession::control_received(websocket::frame_type kind, std::string_view payload) {
  if (kind == websocket::frame_type::pong) pings_.answered(payload, Clock::now());
  if (kind != websocket::frame_type::close || !has_unknown_close(ws_) || closing_) return;
  close(websocket::close_code::protocol_error, "");
  is_close_answered_ = true;
  ws_.async_close(*closing_, [self = shared_from_this()](const error_code&) {});
}

asio::awaitable<void> SenderSession::pause_reading(Clock::time_point until) {
  reader_timer_.expires_at(until);
  co_await reader_timer_.async_wait(kAwait);
}

asio::awaitable<void> SenderSession::write_answers() {
  if (!co_await write(hello_text())) co_return;
  while (!is_ended_ && !is_close_answered_) {
    if (auto answer = next_answer()) {
      if (!co_await write(std::move(*answer))) co_return;
      continue;
    }
    if (is_stopping_ && is_all_answered()) close(websocket::close_code::going_away, "the server stops");
    if (closing_) {
      co_await ws_.async_close(*closing_, kAwait);
      end(false, "closed by the server");
      co_return;
    }
    writer_signal_.expires_at(Clock::time_point::max());
    co_await writer_signal_.async_wait(kAwait);
  }
}

asio::awaitable<bool> SenderSession::write(std::string text) {
  ws_.text(true);
  is_writing_ = true;
  const auto [error, size] = co_await ws_.async_write(asio::buffer(text), kAwait);
  is_writing_ = false;
  if (error) end(false, error.message());
  co_return !error;
}

asio::awaitable<void> SenderSession::mind_deadlines() {
  const NetLimits& limits = context_.options.limits;
  const auto& counted = beast::get_lowest_layer(ws_).rate_policy();
  std::uint64_t written_bytes = 0, read_bytes = 0;
  auto last_write_progress = Clock::now(), last_reading = Clock::now();
  while (!is_ended_) {
    minder_timer_.expires_after(limits.tick);
    co_await minder_timer_.async_wait(kAwait);
    if (is_ended_) co_return;
    const auto now = Clock::now();
    if (!is_writing_ || counted.written_bytes() != written_bytes) last_write_progress = now;
    written_bytes = counted.written_bytes();
    if (is_reading_held_up() || counted.read_bytes() != read_bytes) last_reading = now;
    read_bytes = counted.read_bytes();
    if (now - last_write_progress >= limits.write_timeout) {
      end(true, "it takes no answers");
    } else if (now - last_reading >= limits.ping_interval + limits.pong_timeout) {
      end(true, "it is silent");
    } else if (const std::string_view why = fault(now); !why.empty()) {
      end(true, why);
    } else if (now >= close_deadline_) {
      end(false, "the close was not finished in time");
    } else if (closing_) {
      continue;
    } else if (!context_.options.access->is_good(who_)) {
      close(kAccessWithdrawn, "access was withdrawn");
    } else if (auto payload = pings_.next(now, limits.ping_interval)) {
      asio::co_spawn(ws_.get_executor(), ping(std::move(*payload)), asio::detached);
    }
  }
}

asio::awaitable<void> SenderSession::ping(std::string payload) {
  const auto self = shared_from_this();
  co_await ws_.async_ping(websocket::ping_data(payload), kAwait);
  pings_.written();
}

void SenderSession::close(std::uint16_t code, std::string_view reason) {
  if (closing_ || is_ended_) return;
  closing_.emplace(static_cast<websocket::close_code>(code), beast::string_view(reason.data(), reason.size()));
  close_deadline_ = Clock::now() + context_.options.limits.close_timeout;
  notify_writer();
  resume_reading();
}

void SenderSession::end(bool is_cut, std::string_view why) {
  if (is_ended_) return;
  is_ended_ = true;
  ended();
  if (is_cut) {
    spdlog::info("{} is cut: {}", kind_.name, why);
  } else {
    spdlog::info("{} has gone: {}", kind_.name, why);
  }
  beast::get_lowest_layer(ws_).close();
  notify_writer();
  resume_reading();
  minder_timer_.cancel();
}

void SenderSession::begin_stop() {
  asio::post(ws_.get_executor(), [self = shared_from_this()] {
    self->is_stopping_ = true;
    self->notify_writer();
  });
}

void SenderSession::cut() {
  asio::post(ws_.get_executor(), [self = shared_from_this()] { self->end(true, "the server stops"); });
}

}  // namespace spectra::net
