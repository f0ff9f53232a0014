#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "server/access/role.hpp"
#include "server/stream/outgoing_frame.hpp"

namespace spectra::net {

/// What hello is to hold: everything, or all but what is the same for every viewer.
enum class HelloForm { Full, Brief };

/// A text for one viewer. The middle of it may be one that many are sent; it is not copied.
struct OutgoingText {
  OutgoingText(std::string whole) : begin(std::move(whole)) {}  // NOLINT(google-explicit-constructor)
  OutgoingText(std::string begin_in, std::shared_ptr<const std::string> middle, std::string_view shared_in,
               std::string end_in)
      : begin(std::move(begin_in)), owner(std::move(middle)), shared(shared_in), end(std::move(end_in)) {}

  std::size_t size_bytes() const { return begin.size() + shared.size() + end.size(); }
  /// Of memory that it takes: what is shared is there anyway.
  std::size_t held_bytes() const { return begin.size() + end.size(); }

  std::string begin;
  std::shared_ptr<const std::string> owner;  ///< Holds what `shared` is a part of.
  std::string_view shared;
  std::string end;
};

/// The network's side of one viewer. Everything of a session runs on its strand, one thing at a time; what is callable
/// from any thread says so.
class ViewerPeer {
 public:
  virtual ~ViewerPeer() = default;

  /// Runs `job` on the strand; from any thread. After the session has ended it is dropped.
  virtual void post(std::function<void()> job) = 0;

  /// The frame lane may have something: next_frame() is asked soon. From any thread.
  virtual void wake() = 0;

  /// Puts a JSON text on the control lane, which goes before frames and never loses anything; when it grows beyond its
  /// bound the viewer is cut.
  virtual void send(OutgoingText text) = 0;

  /// What the viewer asked for as it connected.
  virtual HelloForm hello_form() const = 0;

  /// As whom the viewer was let in.
  virtual access::AccessRole role() const = 0;

  /// Round trip of the last answered ping, milliseconds; 0 before the first.
  virtual double round_trip_ms() const = 0;

  /// Bytes on the control lane that are not written yet, without those that are shared.
  virtual std::size_t queued_bytes() const = 0;

  /// Room for an answer of at most so many bytes that is about to be made, as long as what is returned is held; see MessageRoom. Null: there
  /// is none for this viewer. From any thread.
  virtual std::shared_ptr<const void> room_for(std::size_t size_bytes) = 0;
};

/// The application's side of one viewer; all calls are made on the session's strand.
class ViewerClient {
 public:
  virtual ~ViewerClient() = default;
  virtual void opened() = 0;
  virtual void text_received(std::string_view text) = 0;
  virtual void binary_received() = 0;
  /// The frame lane: what to write next, or nothing now.
  virtual std::optional<stream::OutgoingFrame> next_frame() = 0;
  /// Called about once a NetLimits::tick.
  virtual void ticked() = 0;
  /// The last call.
  virtual void closed() = 0;
};

using ViewerClientFactory = std::function<std::shared_ptr<ViewerClient>(std::shared_ptr<ViewerPeer> peer)>;

}  // namespace spectra::net
