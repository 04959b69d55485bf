// A controller in C++: answers every measurement with one drive that carries the same sequence.
#include <memory>

#include "afm_msgs/msg/measurement.hpp"
#include "afm_msgs/msg/piezo_drive.hpp"
#include "pd_law.hpp"
#include "rclcpp/rclcpp.hpp"

using afm_msgs::msg::Measurement;
using afm_msgs::msg::PiezoDrive;

class CppController : public rclcpp::Node
{
public:
  CppController() : Node("cpp_controller", "afm")
  {
    law_.kp = declare_parameter("kp", law_.kp);
    law_.kd = declare_parameter("kd", law_.kd);
    drive_ = create_publisher<PiezoDrive>("piezo_drive", 10);
    measurement_ = create_subscription<Measurement>(
      "measurement", 10, [this](const Measurement & m) { on_measurement(m); });
  }

private:
  void on_measurement(const Measurement & m)
  {
    PiezoDrive answer;
    answer.header = m.header;
    answer.sequence = m.sequence;
    answer.voltage.x =
      law_(m.reference_position.x, m.position.x, m.reference_velocity.x, m.velocity.x);
    answer.voltage.y =
      law_(m.reference_position.y, m.position.y, m.reference_velocity.y, m.velocity.y);
    answer.voltage.z = m.drive.z;
    drive_->publish(answer);
  }

  PdLaw law_;
  rclcpp::Publisher<PiezoDrive>::SharedPtr drive_;
  rclcpp::Subscription<Measurement>::SharedPtr measurement_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<CppController>());
  rclcpp::shutdown();
  return 0;
}
