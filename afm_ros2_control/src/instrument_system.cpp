// The hardware component: measurements become states, efforts become drives, and each cycle is one control period.
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "afm_msgs/msg/measurement.hpp"
#include "afm_msgs/msg/piezo_drive.hpp"
#include "afm_ros2_control/exchange.hpp"
#include "hardware_interface/system_interface.hpp"
#include "pluginlib/class_list_macros.hpp"
#include "rcl/time.h"
#include "rclcpp/rclcpp.hpp"

namespace afm_ros2_control
{

using CallbackReturn = hardware_interface::CallbackReturn;
using hardware_interface::return_type;

namespace
{
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr std::array<const char *, 3> axes{"x", "y", "z"};
constexpr std::int64_t nanoseconds = 1'000'000'000;
// Wall time that a cycle waits for a measurement, before it lets the manager switch controllers: while the instrument waits
// for an answer itself, and else, when the next one is under way.
constexpr auto idle = std::chrono::milliseconds(20);
constexpr auto patience = std::chrono::milliseconds(500);

Axes axes_of(const geometry_msgs::msg::Vector3 & v) { return {v.x, v.y, v.z}; }

Measurement from_message(const afm_msgs::msg::Measurement & m)
{
  Measurement made;
  made.run_id = m.run_id;
  made.sequence = m.sequence;
  made.stamp = m.header.stamp.sec * nanoseconds + m.header.stamp.nanosec;
  made.position = axes_of(m.position);
  made.velocity = axes_of(m.velocity);
  made.reference_position = axes_of(m.reference_position);
  made.reference_velocity = axes_of(m.reference_velocity);
  made.drive = axes_of(m.drive);
  made.deflection = m.deflection;
  made.deflection_rate = m.deflection_rate;
  made.deflection_voltage = m.deflection_voltage;
  return made;
}

afm_msgs::msg::PiezoDrive to_message(const Answer & answer)
{
  afm_msgs::msg::PiezoDrive drive;
  drive.header.frame_id = "scanner";
  drive.header.stamp.sec = static_cast<std::int32_t>(answer.stamp / nanoseconds);
  drive.header.stamp.nanosec = static_cast<std::uint32_t>(answer.stamp % nanoseconds);
  drive.run_id = answer.run_id;
  drive.sequence = answer.sequence;
  drive.voltage.x = answer.voltage[0];
  drive.voltage.y = answer.voltage[1];
  drive.voltage.z = answer.voltage[2];
  return drive;
}
}  // namespace

class InstrumentSystem : public hardware_interface::SystemInterface
{
public:
  ~InstrumentSystem() override { stop_waking(); }

  CallbackReturn on_init(const hardware_interface::HardwareComponentInterfaceParams & params) override
  {
    if (SystemInterface::on_init(params) != CallbackReturn::SUCCESS) {
      return CallbackReturn::ERROR;
    }
    const double period = number("control_period");
    if (!(period >= 1e-9)) {
      RCLCPP_ERROR(
        get_logger(), "control_period is not a positive number of seconds: give plant.control_period of the instrument, "
        "<param name=\"control_period\">2e-5</param>");
      return CallbackReturn::ERROR;
    }
    exchange_ = std::make_unique<Exchange>(std::llround(period * 1e9));
    const auto named = get_hardware_info().hardware_parameters.find("namespace");
    if (named != get_hardware_info().hardware_parameters.end()) {
      namespace_ = named->second;
    }
    ours_ = get_clock()->get_clock_type() == RCL_ROS_TIME && get_clock()->ros_time_is_active();
    if (ours_) {
      keep_waking();
    } else {
      RCLCPP_WARN(
        get_logger(), "controllers get periods of wall time: start the controller manager with use_sim_time "
        "and without a /clock (-r /clock:=/no_clock) for exact ones");
    }
    return CallbackReturn::SUCCESS;
  }

  CallbackReturn on_activate(const rclcpp_lifecycle::State &) override
  {
    for (const char * axis : axes) {
      command(axis, nan);
    }
    const rclcpp::QoS quality(10);
    drive_ = get_node()->create_publisher<afm_msgs::msg::PiezoDrive>(namespace_ + "/piezo_drive", quality);
    measurement_ = get_node()->create_subscription<afm_msgs::msg::Measurement>(
      namespace_ + "/measurement", quality, [this](const afm_msgs::msg::Measurement & message) {
        if (const auto again = exchange_->arrived(from_message(message))) {
          drive_->publish(to_message(*again));
        }
      });
    return CallbackReturn::SUCCESS;
  }

  CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) override
  {
    measurement_.reset();
    drive_.reset();
    return CallbackReturn::SUCCESS;
  }

  // An axis whose controller stops has no command.
  return_type perform_command_mode_switch(
    const std::vector<std::string> &, const std::vector<std::string> & stopped) override
  {
    for (const char * axis : axes) {
      for (const std::string & name : stopped) {
        if (name == effort(axis)) {
          command(axis, nan);
        }
      }
    }
    return return_type::OK;
  }

  return_type read(const rclcpp::Time &, const rclcpp::Duration &) override
  {
    stop_waking();
    const Read found = exchange_->read(exchange_->asked() ? idle : patience);
    set_time(exchange_->time());
    if (found == Read::fresh || found == Read::wrong_period) {
      show(exchange_->newest());
    }
    if (found == Read::wrong_period) {
      RCLCPP_ERROR(
        get_logger(), "control_period = %g s is not that of the instrument: measurement %lu is at %g s",
        1e-9 * static_cast<double>(exchange_->period()), exchange_->newest().sequence,
        1e-9 * static_cast<double>(exchange_->newest().stamp));
      return return_type::ERROR;
    }
    return return_type::OK;
  }

  return_type write(const rclcpp::Time &, const rclcpp::Duration &) override
  {
    Axes commands;
    for (std::size_t i = 0; i < axes.size(); ++i) {
      const std::string name = effort(axes[i]);
      commands[i] = has_command(name) ? get_command(name) : nan;
    }
    if (const auto answer = exchange_->write(commands)) {
      drive_->publish(to_message(*answer));
    }
    // The manager sleeps until the end of its period.
    set_time(exchange_->time() + exchange_->period());
    return return_type::OK;
  }

private:
  static std::string effort(const std::string & joint) { return joint + "/effort"; }

  double number(const std::string & name) const
  {
    const auto & all = get_hardware_info().hardware_parameters;
    const auto found = all.find(name);
    try {
      return found == all.end() ? nan : std::stod(found->second);
    } catch (const std::exception &) {
      return nan;
    }
  }

  void command(const std::string & axis, double value)
  {
    if (has_command(effort(axis))) {
      set_command(effort(axis), value);
    }
  }

  void show(const std::string & joint, double position, double velocity, double volts)
  {
    const std::array<std::pair<const char *, double>, 3> all{
      {{"/position", position}, {"/velocity", velocity}, {"/effort", volts}}};
    for (const auto & [name, value] : all) {
      if (has_state(joint + name)) {
        set_state(joint + name, value);
      }
    }
  }

  void show(const Measurement & m)
  {
    for (std::size_t i = 0; i < axes.size(); ++i) {
      const std::string axis = axes[i];
      // The reference along z is for the tip, whose height is the deflection as long as cantilever.a is 0.
      const double position = i == 2 ? m.deflection : m.position[i];
      const double velocity = i == 2 ? m.deflection_rate : m.velocity[i];
      show(axis, m.position[i], m.velocity[i], m.drive[i]);
      show(axis + "_error", position - m.reference_position[i], velocity - m.reference_velocity[i], 0.0);
    }
    show("tip", m.deflection, m.deflection_rate, m.deflection_voltage);
  }

  // Set the clock of the manager and of all controllers, so that a period is exactly that of the instrument.
  void set_time(std::int64_t since_start)
  {
    if (ours_) {
      const auto clock = get_clock();
      const std::lock_guard<std::mutex> lock(clock->get_clock_mutex());
      (void)rcl_set_ros_time_override(clock->get_clock_handle(), begin_ + since_start);
    }
  }

  // The manager sleeps for a period before its first cycle: let time go on until that cycle.
  void keep_waking()
  {
    waking_ = true;
    waker_ = std::thread([this] {
      while (waking_) {
        begin_ += exchange_->period();
        set_time(0);
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
      }
    });
  }

  void stop_waking()
  {
    waking_ = false;
    if (waker_.joinable()) {
      waker_.join();
    }
  }

  std::unique_ptr<Exchange> exchange_;
  std::string namespace_ = "/afm";
  bool ours_ = false;       // whether this component sets the clock
  std::int64_t begin_ = 0;  // time at the start of the exchange [ns]
  std::atomic<bool> waking_{false};
  std::thread waker_;
  rclcpp::Publisher<afm_msgs::msg::PiezoDrive>::SharedPtr drive_;
  rclcpp::Subscription<afm_msgs::msg::Measurement>::SharedPtr measurement_;
};

}  // namespace afm_ros2_control

PLUGINLIB_EXPORT_CLASS(afm_ros2_control::InstrumentSystem, hardware_interface::SystemInterface)
