// The consumer's half of irsbot in C++17, standard library only: what a drive or a controller makes of verdicts.
// Call hear() for every irsbot_msgs/msg/Verdict and allowed() before every step; see irsbot_supervisor/consumer.py.
// node: an rclcpp::Node with the clock of the supervisor (use_sim_time as there). steady_ns(): a steady clock, ns.
//
//   irsbot::Consumer consumer;
//   auto on_verdict = [&](const irsbot_msgs::msg::Verdict & v) {
//     consumer.hear(v.level, v.sequence, v.speed_scale, steady_ns(), (node->now() - v.header.stamp).seconds());
//   };
//   double share = consumer.allowed(steady_ns());  // every cycle; 0: brake
//
//   irsbot::LastCommand<Rates> last(consumer);     // where commands of velocities come: last.take(rates, steady_ns())
//   const Rates * rates = last.now(steady_ns());   // every cycle; nullptr: brake
//
// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <stdexcept>
#include <type_traits>
#include <utility>

namespace irsbot {

constexpr double kTimeout = 0.1;  // s

class Consumer {
 public:
  // timeout_s: silence after which to brake; above 0.1 s an assumption of the stopping theorem is broken.
  // gated: all commands pass the command gate.
  // Throws std::invalid_argument for a time-out that is not positive and finite.
  explicit Consumer(double timeout_s = kTimeout, bool gated = false) : timeout_s_(timeout_s), gated_(gated) {
    if (!(timeout_s > 0.0 && std::isfinite(timeout_s))) {
      throw std::invalid_argument("the time-out of a consumer must be positive and finite");
    }
  }

  // Consumer(true) would be a time-out of 1 s: write Consumer(irsbot::kTimeout, true).
  template <typename T, typename = std::enable_if_t<std::is_same_v<T, bool>>>
  explicit Consumer(T timeout_s, bool gated = false) = delete;

  // A verdict has come. now_ns: steady clock. age_s: by the clock that stamps, now minus the stamp of the verdict.
  void hear(int level, std::uint64_t sequence, double speed_scale, std::int64_t now_ns, double age_s = 0.0) {
    const bool follows = any_ && sequence > sequence_ && is_fresh(now_ns);
    following_ = follows ? following_ + 1 : 0;
    begun_ns_ = follows ? begun_ns_ : now_ns;
    heard_ns_ = now_ns, sequence_ = sequence, any_ = true;
    const bool allows = level == kOk || level == kWarn || (gated_ && level == kStop);
    const bool timely = std::abs(age_s) <= timeout_s_;  // false for NaN
    const bool lasting = static_cast<double>(now_ns - begun_ns_) >= std::fmax(timeout_s_, kTimeout) * 1e9;
    const bool in_sequence = following_ >= kInSequence && lasting;
    const bool known = allows && timely && speed_scale > 0.0 && speed_scale <= 1.0 && in_sequence;
    scale_ = known ? (gated_ ? 1.0 : speed_scale) : 0.0;
    note(scale_);
  }

  // Share of the speed limits that may be used now, 0..1; 0 means brake.
  double allowed(std::int64_t now_ns) {
    const double scale = is_fresh(now_ns) ? scale_ : 0.0;
    note(scale);
    return scale;
  }

  // How often motion has ended. Commands from before the last end are void.
  std::uint64_t brakes() const { return brakes_; }

 private:
  static constexpr int kOk = 0, kWarn = 1, kStop = 2, kInSequence = 2;

  bool is_fresh(std::int64_t now_ns) const { return static_cast<double>(std::abs(now_ns - heard_ns_)) <= timeout_s_ * 1e9; }

  void note(double scale) {
    if (scale > 0.0) {
      braking_ = false;
    } else if (!braking_) {
      braking_ = true, following_ = 0, scale_ = 0.0, ++brakes_;
    }
  }

  double timeout_s_, scale_ = 0.0;
  bool gated_, any_ = false, braking_ = true;
  int following_ = 0;
  std::int64_t heard_ns_ = 0, begun_ns_ = 0;
  std::uint64_t sequence_ = 0, brakes_ = 0;
};

// The last command to a consumer, as long as it counts. One that comes while motion is forbidden may have been sent
// before motion ended, and waited while this process was paused: it is void, as is every command from before the end.
template <typename Command>
class LastCommand {
 public:
  explicit LastCommand(Consumer & consumer) : consumer_(consumer) {}

  // A command has come. It is void if motion is forbidden now.
  void take(Command command, std::int64_t now_ns) {
    given_ = consumer_.allowed(now_ns) > 0.0;
    command_ = std::move(command), brakes_ = consumer_.brakes();
  }

  // The command to follow; nullptr: brake.
  const Command * now(std::int64_t now_ns) {
    consumer_.allowed(now_ns);  // a silence until now has ended motion
    return given_ && brakes_ == consumer_.brakes() ? &command_ : nullptr;
  }

 private:
  Consumer & consumer_;
  Command command_{};
  bool given_ = false;
  std::uint64_t brakes_ = 0;
};

}  // namespace irsbot
