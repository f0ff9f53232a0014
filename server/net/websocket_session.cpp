#include "server/net/websocket_session.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/http/field.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <exception>
#include <utility>

#include "server/net/request_right.hpp"
#include "server/net/steady_seconds.hpp"
#include "server/net/websocket_setup.hpp"

namespace spectra::net {
namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = boost::beast::websocket;
using boost::system::error_code;

WebSocketSession::WebSocketSession(Transport stream, ServerContext& context, HelloForm hello_form,
                                   access::AccessControl::Identity who)
    : ws_(std::move(stream)),
      context_(context),
      writer_signal_(ws_.get_executor(), asio::steady_timer::time_point::max()),
      minder_timer_(ws_.get_executor()),
      reader_timer_(ws_.get_executor()),
      messages_(context.options.limits.messages_per_s,
                context.options.limits.messages_per_s * context.options.limits.message_burst_s),
      message_bytes_(context.options.limits.message_bytes_per_s,
                     context.options.limits.message_bytes_per_s * context.options.limits.message_burst_s),
      hello_form_(hello_form),
      who_(std::move(who)) {}

/// That a session is there: it is put in order when this ends, also where the coroutine is lost because no memory was there to go on.
class WebSocketSession::Presence {
 public:
  explicit Presence(WebSocketSession& session) : session_(session), metrics_(session.context_.metrics) {
    metrics_.viewers += 1;
    metrics_.viewers_total += 1;
    metrics_.of(session_.who_.role).viewers += 1;
  }
  ~Presence() {
    session_.finish();
    metrics_.viewers -= 1;
    metrics_.of(session_.who_.role).viewers -= 1;
    session_.uncount(session_.control_bytes_);
  }
  Presence(const Presence&) = delete;
  Presence& operator=(const Presence&) = delete;

 private:
  WebSocketSession& session_;
  NetMetrics& metrics_;
};

/// Held by each of a session's coroutines: where one of them ends or is lost, the others do not wait for ever.
class WebSocketSession::Part {
 public:
  explicit Part(WebSocketSession& session) : session_(session.shared_from_this()) {}
  ~Part() {
    // After a close that is answered the reader sees the end.
    if (session_->is_close_answered_) return;
    try {
      session_->end(false, "");
    } catch (const std::exception& error) {
      spdlog::error("a viewer's connection could not be closed: {}", error.what());
    }
  }
  Part(const Part&) = delete;
  Part& operator=(const Part&) = delete;

 private:
  const std::shared_ptr<WebSocketSession> session_;
};

asio::awaitable<void> WebSocketSession::run(UpgradeRequest request) {
  using namespace asio::experimental::awaitable_operators;
  const auto self = shared_from_this();
  const NetLimits& limits = context_.options.limits;
  beast::get_lowest_layer(ws_).expires_never();
  set_up_websocket(ws_, limits.header_timeout, "spectra.v1", limits.message_size_bytes);
  ws_.control_callback([this](websocket::frame_type kind, beast::string_view payload) {
    if (kind == websocket::frame_type::close) refuse_unknown_close();
    if (kind != websocket::frame_type::pong) return;
    if (const auto round_trip = pings_.answered({payload.data(), payload.size()}, Clock::now())) {
      round_trip_ms_ = std::chrono::duration<double, std::milli>(*round_trip).count();
    }
  });

  const auto [accept_error] = co_await ws_.async_accept(request, kAwait);
  const Registration registration(context_, self);
  if (accept_error || !registration.is_taken()) {
    beast::get_lowest_layer(ws_).close();
    co_return;
  }
  const Presence presence(*this);
  is_open_ = true;
  try {
    share_.emplace(context_.messages, [weak_self = weak_from_this()] {
      if (const auto session = weak_self.lock()) {
        asio::post(session->ws_.get_executor(), [session] { session->cut_off(); });
      }
    });
    client_ = context_.viewers(self);
    client_->opened();
    co_await (read_messages() && write_messages() && mind_deadlines());
  } catch (const std::exception& error) {
    spdlog::error("a viewer's session failed: {}", error.what());
  }
}

void WebSocketSession::finish() noexcept {
  try {
    end(false, "");
  } catch (const std::exception& error) {
    spdlog::error("a viewer's connection could not be closed: {}", error.what());
  }
  try {
    if (client_) client_->closed();
  } catch (const std::exception& error) {
    spdlog::error("a viewer's session could not be put in order: {}", error.what());
  }
}

asio::awaitable<void> WebSocketSession::read_messages() {
  const Part part(*this);
  beast::flat_buffer buffer;
  while (!is_ended_) {
    const auto [error, size] = co_await ws_.async_read(buffer, kAwait);
    if (error) {
      end(false, error.message());
      co_return;
    }
    if (is_ended_) co_return;
    context_.metrics.messages_received += 1;
    if (!closing_) {
      if (ws_.got_binary()) {
        client_->binary_received();
      } else {
        client_->text_received({static_cast<const char*>(buffer.data().data()), size});
      }
    }
    buffer.consume(buffer.size());
    // A flood is slowed down by not reading on; the kernel's window then holds the sender.
    co_await pause(messages_, 1);
    co_await pause(message_bytes_, static_cast<double>(size));
  }
}

asio::awaitable<void> WebSocketSession::pause(access::TokenBucket& bucket, double count) {
  while (!bucket.take(steady_seconds(), count) && !is_ended_) {
    reader_timer_.expires_after(std::chrono::duration_cast<Clock::duration>(
        std::chrono::duration<double>(bucket.wait_s(steady_seconds(), count))));
    co_await reader_timer_.async_wait(kAwait);
  }
}

template <class Buffers>
asio::awaitable<bool> WebSocketSession::write(Buffers buffers, bool is_text) {
  ws_.text(is_text);
  is_writing_ = true;
  const auto [error, size] = co_await ws_.async_write(buffers, kAwait);
  is_writing_ = false;
  if (error) end(false, error.message());
  co_return !error;
}

asio::awaitable<void> WebSocketSession::write_messages() {
  const Part part(*this);
  while (!is_ended_ && !is_close_answered_) {
    if (closing_) {
      co_await ws_.async_close(*closing_, kAwait);
      end(false, "closed by the server");
      co_return;
    }
    if (!control_.empty()) {
      const OutgoingText text = std::move(control_.front());
      control_.pop_front();
      const std::array<asio::const_buffer, 3> buffers{asio::buffer(text.begin), asio::buffer(text.shared),
                                                      asio::buffer(text.end)};
      if (!co_await write(buffers, true)) co_return;
      uncount(text.held_bytes());
      context_.metrics.messages_sent += 1;
      continue;
    }
    if (may_have_frame_) {
      if (const auto frame = client_->next_frame()) {
        const std::array<asio::const_buffer, 2> buffers{
            asio::buffer(frame->header), frame->payload ? asio::buffer(*frame->payload) : asio::const_buffer{}};
        if (!co_await write(buffers, false)) co_return;
        context_.metrics.frames_sent += 1;
        context_.metrics.frame_bytes_sent += frame->size_bytes();
        context_.metrics.of(who_.role).frames_sent += 1;
        context_.metrics.of(who_.role).frame_bytes_sent += frame->size_bytes();
        continue;
      }
      may_have_frame_ = false;
      continue;
    }
    writer_signal_.expires_at(Clock::time_point::max());
    co_await writer_signal_.async_wait(kAwait);
  }
}

asio::awaitable<void> WebSocketSession::mind_deadlines() {
  const Part part(*this);
  const NetLimits& limits = context_.options.limits;
  const auto& counted = beast::get_lowest_layer(ws_).rate_policy();
  std::uint64_t written_bytes = 0;
  std::uint64_t moved_bytes = 0;
  auto last_write_progress = Clock::now();
  auto last_reading = Clock::now();
  auto last_move = Clock::now();
  while (!is_ended_) {
    minder_timer_.expires_after(limits.tick);
    co_await minder_timer_.async_wait(kAwait);
    if (is_ended_) co_return;
    const auto now = Clock::now();
    if (!is_writing_ || counted.written_bytes() != written_bytes) {
      // Only a write that waited says that the peer reads; the kernel takes others as they come.
      if (is_writing_) last_reading = now;
      written_bytes = counted.written_bytes();
      last_write_progress = now;
    }
    if (!pings_.is_out()) last_reading = now;
    if (counted.read_bytes() + counted.written_bytes() != moved_bytes) {
      moved_bytes = counted.read_bytes() + counted.written_bytes();
      last_move = now;
    }
    if (now - last_write_progress >= limits.write_timeout) {
      end(true, "it takes no bytes");
    } else if (now - last_reading >= limits.pong_timeout) {
      end(true, "it answers no ping");
    } else if (now - last_move >= limits.idle_timeout) {
      end(true, "it is silent");
    } else if (now >= close_deadline_) {
      end(false, "the close was not finished in time");
    } else if (!closing_ && !context_.options.access->is_good(who_)) {
      close({static_cast<websocket::close_code>(kAccessWithdrawn), "access was withdrawn"});
    } else if (!closing_ && share_->has_given_way()) {
      cut_off();
    } else if (!closing_) {
      client_->ticked();
      if (auto payload = pings_.next(now, limits.ping_interval)) {
        asio::co_spawn(ws_.get_executor(), ping(std::move(*payload)), asio::detached);
      }
    }
  }
}

asio::awaitable<void> WebSocketSession::ping(std::string payload) {
  const auto self = shared_from_this();
  co_await ws_.async_ping(websocket::ping_data(payload), kAwait);
  pings_.written();
}

void WebSocketSession::refuse_unknown_close() {
  // Not beside a close that has begun.
  if (!has_unknown_close(ws_) || closing_) return;
  close(websocket::close_code::protocol_error);
  is_close_answered_ = true;
  ws_.async_close(*closing_, [self = shared_from_this()](const error_code&) {});
}

void WebSocketSession::post(std::function<void()> job) {
  asio::post(ws_.get_executor(), [self = shared_from_this(), job = std::move(job)] {
    if (!self->is_open_ || self->is_ended_) return;
    try {
      job();
    } catch (const std::exception& error) {
      spdlog::error("a viewer's session failed: {}", error.what());
      self->end(true, "of an internal error");
    }
  });
}

void WebSocketSession::wake() {
  asio::post(ws_.get_executor(), [self = shared_from_this()] {
    self->may_have_frame_ = true;
    self->notify_writer();
  });
}

void WebSocketSession::send(OutgoingText text) {
  if (is_ended_ || closing_) return;
  const std::size_t bytes = text.held_bytes();
  control_.push_back(std::move(text));
  control_bytes_ += bytes;
  context_.metrics.of(who_.role).queued_bytes += static_cast<std::int64_t>(bytes);
  share_->add(bytes);
  if (control_bytes_ > context_.options.limits.control_queue_bytes) return cut_off();
  notify_writer();
}

void WebSocketSession::uncount(std::size_t bytes) {
  bytes = std::min(bytes, control_bytes_);
  if (bytes == 0) return;
  control_bytes_ -= bytes;
  context_.metrics.of(who_.role).queued_bytes -= static_cast<std::int64_t>(bytes);
  share_->remove(bytes);
}

void WebSocketSession::cut_off() {
  if (closing_ || is_ended_) return;
  context_.metrics.viewers_cut += 1;
  context_.metrics.of(who_.role).viewers_cut += 1;
  close({websocket::close_code::policy_error, "messages to you pile up unread"});
}

void WebSocketSession::close(websocket::close_reason reason) {
  if (closing_ || is_ended_) return;
  closing_ = std::move(reason);
  close_deadline_ = Clock::now() + context_.options.limits.close_timeout;
  for (; !control_.empty(); control_.pop_front()) uncount(control_.front().held_bytes());
  notify_writer();
}

void WebSocketSession::end(bool is_cut, std::string_view why) {
  if (is_ended_) return;
  is_ended_ = true;
  if (is_cut) {
    context_.metrics.viewers_cut += 1;
    context_.metrics.of(who_.role).viewers_cut += 1;
    spdlog::info("a viewer is cut: {}", why);
  } else {
    spdlog::debug("a viewer's session ended: {}", why);
  }
  beast::get_lowest_layer(ws_).close();
  writer_signal_.cancel();
  minder_timer_.cancel();
  reader_timer_.cancel();
}

void WebSocketSession::notify_writer() {
  writer_signal_.cancel();
}

void WebSocketSession::begin_stop() {
  asio::post(ws_.get_executor(), [self = shared_from_this()] {
    self->close({websocket::close_code::going_away, "the server stops"});
  });
}

void WebSocketSession::cut() {
  asio::post(ws_.get_executor(), [self = shared_from_this()] { self->end(true, "the server stops"); });
}

}  // namespace spectra::net
