// Proportional-derivative tracking of one axis; knows nothing of ROS, so that it can be tested without.
#pragma once

struct PdLaw
{
  double kp = 3e10;  // [V/m]
  double kd = 6e5;   // [V s/m]

  double operator()(double reference, double position, double reference_rate, double rate) const
  {
    return kp * (reference - position) + kd * (reference_rate - rate);
  }
};
