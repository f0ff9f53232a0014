#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

namespace spectra::net {

/// The memory that the messages to all viewers may take together, from when an answer begins to be made until it is written. Where there is
/// no room, whoever holds most of it gives way; of those who hold at least half as much, the one who has taken nothing for longest. Nobody
/// does where that would not make room. Messages may go beyond it by a half, while answers that are being made take most of it. Thread-safe.
class MessageRoom : public std::enable_shared_from_this<MessageRoom> {
  struct Holder;

 public:
  explicit MessageRoom(std::size_t size_bytes) : size_bytes_(size_bytes) {}

  /// What the messages to one viewer take. Given back with it.
  class Share {
   public:
    /// `give_way` is called from any thread, at most once: all that waits is to be dropped. From then on nothing of this share counts.
    Share(std::shared_ptr<MessageRoom> room, std::function<void()> give_way);
    ~Share();
    Share(const Share&) = delete;
    Share& operator=(const Share&) = delete;

    /// A message waits to be written. There is room for it; who gives way for that may be this viewer.
    void add(std::size_t bytes);
    /// One that waited has been written or dropped.
    void remove(std::size_t bytes);
    /// Room for an answer that is about to be made, as long as what is returned is held. Null: there is none, and nobody who keeps messages
    /// waiting holds more than this viewer.
    std::shared_ptr<const void> take(std::size_t bytes);

    /// Also where `give_way` could not be called, or has thrown, because no memory was there.
    bool has_given_way() const;

   private:
    const std::shared_ptr<MessageRoom> room_;
    const std::shared_ptr<Holder> holder_;
  };

  /// What is held of it now.
  std::size_t used_bytes() const;

 private:
  using Holders = std::vector<std::shared_ptr<Holder>>;

  // With the lock held.
  /// Makes room for so many bytes at the cost of those who hold more than that; they are to be told without the lock. False: there is none.
  bool make_room(std::size_t bytes, std::size_t more_than_bytes, Holders& dropped);
  /// Of those who keep messages waiting and hold more than that, all together.
  std::size_t bytes_that_wait(std::size_t more_than_bytes, std::size_t (Holder::*bytes)() const) const;
  /// One that keeps messages waiting and holds more than so much; null: none.
  std::shared_ptr<Holder> who_gives_way(std::size_t more_than_bytes) const;
  void give_back(Holder& holder, std::size_t bytes);
  // Without it.
  static void tell(const Holders& dropped);

  const std::size_t size_bytes_;
  mutable std::mutex mutex_;
  Holders holders_;
  std::size_t used_bytes_ = 0;
  std::uint64_t message_count_ = 0;  // Ever: it stands for the time.
};

}  // namespace spectra::net
