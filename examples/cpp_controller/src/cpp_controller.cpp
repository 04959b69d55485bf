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
    lateral_.kp = declare_parameter("kp", lateral_.kp);
    lateral_.kd = declare_parameter("kd", lateral_.kd);
    drive_ = create_publisher<PiezoDrive>("piezo_drive", 10);
    measurement_ = create_subscription<Measurement>(
      "measurement", 10, [this](const Measurement & m) { on_measurement(m); });
  }

private:
  void on_measurement(const Measurement & m)
  {
    PiezoDrive answer;
    answer.header = m.header;
    answer.run_id = m.run_id;
    answer.sequence = m.sequence;
    answer.voltage.x =
      lateral_(m.reference_position.x, m.position.x, m.reference_velocity.x, m.velocity.x);
    answer.voltage.y =
      lateral_(m.reference_position.y, m.position.y, m.reference_velocity.y, m.velocity.y);
    // The height of the tip is the deflection, as long as cantilever.a is 0.
    answer.voltage.z =
      height_(m.reference_position.z, m.deflection, m.reference_velocity.z, m.velocity.z);
    drive_->publish(answer);
  }

  PdLaw lateral_;
  PdLaw height_{5.2e8, 8.4e4};
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
