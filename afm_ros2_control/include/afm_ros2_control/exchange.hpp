// What the hardware component does, without ROS: one measurement is read, one drive answers it, and a clock for controllers.
#pragma once

#include <array>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <utility>

namespace afm_ros2_control
{

using Axes = std::array<double, 3>;  // x, y, z

// The fields of afm_msgs/Measurement that controllers use, in SI units.
struct Measurement
{
  std::uint64_t run_id = 0;
  std::uint64_t sequence = 0;
  std::int64_t stamp = 0;  // simulated time [ns]
  Axes position{};
  Axes velocity{};
  Axes reference_position{};
  Axes reference_velocity{};
  Axes drive{};  // in force until this measurement [V]
  double deflection = 0.0;
  double deflection_rate = 0.0;
  double deflection_voltage = 0.0;
};

// The fields of afm_msgs/PiezoDrive.
struct Answer
{
  std::uint64_t run_id = 0;
  std::uint64_t sequence = 0;
  std::int64_t stamp = 0;  // of the measurement answered [ns]
  Axes voltage{};
};

enum class Read
{
  fresh,         // the next measurement
  again,         // the same measurement, which nobody has answered yet
  nothing,       // answered, and the next one has not come
  wrong_period,  // the next measurement, which is not a whole number of control periods later
};

// One thread receives; another one reads and writes in turn.
class Exchange
{
public:
  // period: control period of the instrument [ns], greater than 0.
  explicit Exchange(std::int64_t period) : period_(period) {}

  // Keep a measurement for the next read. Returns the answer to send again if it was answered before: the instrument
  // repeats a measurement whose answer did not reach it.
  std::optional<Answer> arrived(const Measurement & measurement)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (newest_ && place(measurement) == place(*newest_)) {
      return answered_ ? sent_ : std::nullopt;
    }
    // Of several that wait the newest counts; those of an earlier run never do.
    const auto & last = waiting_ ? waiting_ : newest_;
    if (!last || place(measurement) > place(*last)) {
      waiting_ = measurement;
      change_.notify_one();
    }
    return std::nullopt;
  }

  // Whether the instrument waits for an answer. Only for the thread that reads and writes.
  bool asked() const { return newest_.has_value() && !answered_; }

  // Wait for the next measurement, for `patience` at most.
  Read read(std::chrono::nanoseconds patience)
  {
    std::unique_lock<std::mutex> lock(mutex_);
    change_.wait_for(lock, patience, [this] { return waiting_.has_value(); });
    if (!waiting_) {
      // Time goes on for controllers and their manager, which sleeps for a period in each cycle: one that becomes active now
      // starts with a whole period.
      time_ += period_;
      return newest_ && !answered_ ? Read::again : Read::nothing;
    }
    const Measurement next = *waiting_;
    waiting_.reset();
    const bool begins = !newest_ || next.run_id != newest_->run_id;
    std::int64_t passed = period_;
    bool whole = true;
    if (begins) {
      held_ = next.drive;
    } else {
      passed = next.stamp - newest_->stamp;
      whole = passed == static_cast<std::int64_t>(next.sequence - newest_->sequence) * period_;
    }
    time_ += passed;
    newest_ = next;
    answered_ = false;
    return whole ? Read::fresh : Read::wrong_period;
  }

  // Answer the measurement read last with commands [V]. NaN is no command: that axis keeps its drive. Returns nothing if no
  // axis is commanded, or if the measurement is answered.
  std::optional<Answer> write(const Axes & commands)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!newest_ || answered_) {
      return std::nullopt;
    }
    bool commanded = false;
    for (std::size_t i = 0; i < commands.size(); ++i) {
      if (!std::isnan(commands[i])) {
        held_[i] = commands[i];
        commanded = true;
      }
    }
    if (!commanded) {
      return std::nullopt;
    }
    answered_ = true;
    sent_ = Answer{newest_->run_id, newest_->sequence, newest_->stamp, held_};
    return sent_;
  }

  // The measurement read last. Only for the thread that reads.
  const Measurement & newest() const { return *newest_; }

  // Time for controllers since the start [ns]: one control period for each tick. It goes on at a reset, where simulated time
  // begins again.
  std::int64_t time() const { return time_; }

  std::int64_t period() const { return period_; }

private:
  // Later runs have a greater run_id.
  static std::pair<std::uint64_t, std::uint64_t> place(const Measurement & measurement)
  {
    return {measurement.run_id, measurement.sequence};
  }

  const std::int64_t period_;
  std::mutex mutex_;
  std::condition_variable change_;
  std::optional<Measurement> waiting_;
  std::optional<Measurement> newest_;
  std::optional<Answer> sent_;
  Axes held_{};
  bool answered_ = false;
  std::int64_t time_ = 0;
};

}  // namespace afm_ros2_control
