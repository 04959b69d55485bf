// The few calls of rclcpp that examples/cpp_controller makes, so that it can be compiled where there is no rclcpp.
#pragma once
#include <functional>
#include <memory>
#include <string>

namespace rclcpp
{
template <class M>
struct Publisher
{
  using SharedPtr = std::shared_ptr<Publisher<M>>;
  std::function<void(const M &)> sent;
  void publish(const M & message) { sent(message); }
};

template <class M>
struct Subscription
{
  using SharedPtr = std::shared_ptr<Subscription<M>>;
};

struct Node
{
  Node(const std::string & name, const std::string & space);
  template <class T>
  T declare_parameter(const std::string &, const T & value)
  {
    return value;
  }
  template <class M>
  typename Publisher<M>::SharedPtr create_publisher(const std::string &, int);
  template <class M>
  typename Subscription<M>::SharedPtr create_subscription(
    const std::string &, int, std::function<void(const M &)>);
};

void init(int, char **);
void spin(std::shared_ptr<Node>);
void shutdown();
}  // namespace rclcpp
