#include "server/net/message_room.hpp"

#include <algorithm>
#include <new>
#include <utility>

namespace spectra::net {

struct MessageRoom::Holder {
  explicit Holder(std::function<void()> give_way_in) : give_way(std::move(give_way_in)) {}

  std::size_t held_bytes() const { return waiting_bytes + taken_bytes; }
  std::size_t waiting_bytes_of() const { return waiting_bytes; }
  bool may_give_way(std::size_t more_than_bytes) const {
    return !has_given_way && waiting_bytes > 0 && held_bytes() > more_than_bytes;
  }

  const std::function<void()> give_way;
  std::size_t waiting_bytes = 0;
  std::size_t taken_bytes = 0;
  std::uint64_t stuck_since = 0;  // While something waits.
  bool has_given_way = false;
};

MessageRoom::Share::Share(std::shared_ptr<MessageRoom> room, std::function<void()> give_way)
    : room_(std::move(room)), holder_(std::make_shared<Holder>(std::move(give_way))) {
  const std::lock_guard lock(room_->mutex_);
  room_->holders_.push_back(holder_);
}

MessageRoom::Share::~Share() {
  const std::lock_guard lock(room_->mutex_);
  room_->give_back(*holder_, std::exchange(holder_->waiting_bytes, 0));
  std::erase(room_->holders_, holder_);
}

void MessageRoom::Share::add(std::size_t bytes) {
  Holders dropped;
  {
    const std::lock_guard lock(room_->mutex_);
    const std::uint64_t now = ++room_->message_count_;
    if (holder_->waiting_bytes == 0) holder_->stuck_since = now;
    holder_->waiting_bytes += bytes;
    if (holder_->has_given_way) return;
    room_->used_bytes_ += bytes;
    // Answers that are being made are soon there: while they are most of it, nobody is cut for a message.
    if (room_->used_bytes_ > room_->size_bytes_ &&
        2 * room_->bytes_that_wait(0, &Holder::waiting_bytes_of) > room_->size_bytes_) {
      room_->make_room(0, 0, dropped);
    }
  }
  tell(dropped);
}

void MessageRoom::Share::remove(std::size_t bytes) {
  const std::lock_guard lock(room_->mutex_);
  holder_->waiting_bytes -= bytes;
  holder_->stuck_since = room_->message_count_;
  room_->give_back(*holder_, bytes);
}

std::shared_ptr<const void> MessageRoom::Share::take(std::size_t bytes) {
  // What is given back when the last who holds it lets go.
  struct Taken {
    Taken(std::shared_ptr<MessageRoom> room_in, std::shared_ptr<Holder> holder_in)
        : room(std::move(room_in)), holder(std::move(holder_in)) {}
    ~Taken() {
      if (bytes == 0) return;
      const std::lock_guard lock(room->mutex_);
      holder->taken_bytes -= bytes;
      room->give_back(*holder, bytes);
    }
    const std::shared_ptr<MessageRoom> room;
    const std::shared_ptr<Holder> holder;
    std::size_t bytes = 0;
  };
  const auto taken = std::make_shared<Taken>(room_, holder_);
  Holders dropped;
  {
    const std::lock_guard lock(room_->mutex_);
    const bool is_there = !holder_->has_given_way && room_->make_room(bytes, holder_->held_bytes(), dropped);
    if (is_there) {
      taken->bytes = bytes;
      holder_->taken_bytes += bytes;
      room_->used_bytes_ += bytes;
    }
  }
  tell(dropped);
  return taken->bytes > 0 ? taken : nullptr;
}

bool MessageRoom::Share::has_given_way() const {
  const std::lock_guard lock(room_->mutex_);
  return holder_->has_given_way;
}

std::size_t MessageRoom::used_bytes() const {
  const std::lock_guard lock(mutex_);
  return used_bytes_;
}

bool MessageRoom::make_room(std::size_t bytes, std::size_t more_than_bytes, Holders& dropped) {
  if (used_bytes_ + bytes <= size_bytes_) return true;
  // Nobody gives way where that is not enough.
  if (used_bytes_ + bytes > size_bytes_ + bytes_that_wait(more_than_bytes, &Holder::held_bytes)) return false;
  while (used_bytes_ + bytes > size_bytes_) {
    const auto holder = who_gives_way(more_than_bytes);
    if (!holder) return false;
    dropped.push_back(holder);
    give_back(*holder, holder->held_bytes());
    holder->has_given_way = true;
  }
  return true;
}

std::size_t MessageRoom::bytes_that_wait(std::size_t more_than_bytes, std::size_t (Holder::*bytes)() const) const {
  std::size_t sum = 0;
  for (const auto& holder : holders_) {
    if (holder->may_give_way(more_than_bytes)) sum += (*holder.*bytes)();
  }
  return sum;
}

std::shared_ptr<MessageRoom::Holder> MessageRoom::who_gives_way(std::size_t more_than_bytes) const {
  std::size_t most_bytes = 0;
  for (const auto& holder : holders_) {
    if (holder->may_give_way(more_than_bytes)) most_bytes = std::max(most_bytes, holder->held_bytes());
  }
  std::shared_ptr<Holder> chosen;
  for (const auto& holder : holders_) {
    if (!holder->may_give_way(more_than_bytes) || holder->held_bytes() < most_bytes / 2) continue;
    if (!chosen || holder->stuck_since < chosen->stuck_since) chosen = holder;
  }
  return chosen;
}

void MessageRoom::tell(const Holders& dropped) {
  for (const auto& holder : dropped) {
    try {
      holder->give_way();
    } catch (const std::bad_alloc&) {
      // It sees it by itself; see has_given_way().
    }
  }
}

void MessageRoom::give_back(Holder& holder, std::size_t bytes) {
  if (!holder.has_given_way) used_bytes_ -= bytes;
}

}  // namespace spectra::net
