// Claims about afm_ros2_control/exchange.hpp; each is a case by name, run by test_ros2_control.py.
#include <cstdio>
#include <cstring>
#include <limits>
#include <thread>

#include "afm_ros2_control/exchange.hpp"

using namespace afm_ros2_control;

namespace
{
constexpr std::int64_t period = 20'000;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr auto no_time = std::chrono::nanoseconds(0);
constexpr auto long_time = std::chrono::seconds(60);
const Axes nobody{nan, nan, nan};
int failures = 0;

#define CHECK(claim) \
  if (!(claim)) { \
    std::printf("line %d: %s\n", __LINE__, #claim); \
    ++failures; \
  }

Measurement measurement(std::uint64_t sequence, std::uint64_t run = 7)
{
  Measurement m;
  m.run_id = run;
  m.sequence = sequence;
  m.stamp = static_cast<std::int64_t>(sequence) * period;
  m.drive = {0.5, -0.5, 0.25};
  return m;
}

// Each read gives the next measurement, each write answers it once, and time goes on by a period.
void one_answer_for_each_measurement()
{
  Exchange exchange(period);
  for (std::uint64_t k = 0; k < 5; ++k) {
    CHECK(!exchange.arrived(measurement(k)));
    CHECK(exchange.read(no_time) == Read::fresh);
    CHECK(exchange.newest().sequence == k);
    CHECK(exchange.time() == static_cast<std::int64_t>(2 * k + 1) * period);
    const auto answer = exchange.write({1.0, 2.0, 3.0});
    CHECK(answer && answer->run_id == 7 && answer->sequence == k && answer->stamp == measurement(k).stamp);
    CHECK(answer && (answer->voltage == Axes{1.0, 2.0, 3.0}));
    CHECK(!exchange.write({1.0, 2.0, 3.0}));
    // The manager sleeps for a period in each cycle, also where nothing has come: time has to go on.
    CHECK(exchange.read(no_time) == Read::nothing);
    CHECK(exchange.time() == static_cast<std::int64_t>(2 * k + 2) * period);
  }
}

void read_waits_for_the_next_measurement()
{
  Exchange exchange(period);
  exchange.arrived(measurement(0));
  CHECK(exchange.read(no_time) == Read::fresh);
  exchange.write({0.0, 0.0, 0.0});
  std::thread instrument([&exchange] { exchange.arrived(measurement(1)); });
  CHECK(exchange.read(long_time) == Read::fresh);
  CHECK(exchange.newest().sequence == 1);
  instrument.join();
}

// Without an active controller nothing is answered, and time goes on: the first period of a controller is a whole one.
void no_command_is_no_answer()
{
  Exchange exchange(period);
  CHECK(!exchange.write(nobody));
  CHECK(exchange.read(no_time) == Read::nothing && !exchange.asked());
  CHECK(exchange.time() == period);
  exchange.arrived(measurement(0));
  CHECK(exchange.read(no_time) == Read::fresh && exchange.asked());
  CHECK(!exchange.write(nobody));
  CHECK(exchange.read(no_time) == Read::again && exchange.asked());
  CHECK(exchange.time() == 3 * period);
  CHECK(!exchange.arrived(measurement(0)));
  const auto answer = exchange.write({nan, nan, 4.0});
  CHECK(answer && answer->sequence == 0 && (answer->voltage == Axes{0.5, -0.5, 4.0}));
}

// Neither activation nor deactivation moves an axis that has no command.
void axis_without_a_command_keeps_its_drive()
{
  Exchange exchange(period);
  const Axes commands[] = {{1.0, nan, nan}, {nan, 2.0, nan}, {nan, nan, 3.0}, {4.0, nan, nan}};
  const Axes voltages[] = {{1.0, -0.5, 0.25}, {1.0, 2.0, 0.25}, {1.0, 2.0, 3.0}, {4.0, 2.0, 3.0}};
  for (std::uint64_t k = 0; k < 4; ++k) {
    Measurement m = measurement(k);
    // Delayed, rounded: what is held is what was sent.
    m.drive = {9.0, 9.0, 9.0};
    if (k == 0) {
      m.drive = {0.5, -0.5, 0.25};
    }
    exchange.arrived(m);
    CHECK(exchange.read(no_time) == Read::fresh);
    const auto answer = exchange.write(commands[k]);
    CHECK(answer && answer->voltage == voltages[k]);
  }
}

void answer_that_was_lost_is_sent_again()
{
  Exchange exchange(period);
  exchange.arrived(measurement(0));
  exchange.read(no_time);
  CHECK(!exchange.arrived(measurement(0)));
  exchange.write({1.0, 2.0, 3.0});
  const auto again = exchange.arrived(measurement(0));
  CHECK(again && again->sequence == 0 && (again->voltage == Axes{1.0, 2.0, 3.0}));
  CHECK(exchange.read(no_time) == Read::nothing);
}

// Time of controllers goes on at a reset; drives begin with those of the instrument; nothing of the old run comes back.
void reset_begins_a_run_and_time_goes_on()
{
  Exchange exchange(period);
  std::int64_t ticks = 0;
  for (std::uint64_t run = 1; run <= 100; ++run) {
    for (std::uint64_t k = 0; k < 3; ++k) {
      exchange.arrived(measurement(k, run));
      CHECK(!exchange.arrived(measurement(7, run - 1)));
      CHECK(exchange.read(no_time) == Read::fresh);
      CHECK(exchange.time() == ++ticks * period);
      const auto answer = exchange.write({nan, 2.0, nan});
      CHECK(answer && answer->run_id == run && answer->sequence == k && (answer->voltage == Axes{0.5, 2.0, 0.25}));
    }
  }
}

// In real time measurements may be skipped: the newest counts, and its period is a whole number of control periods.
void newest_measurement_counts()
{
  Exchange exchange(period);
  exchange.arrived(measurement(0));
  exchange.read(no_time);
  exchange.arrived(measurement(3));
  exchange.arrived(measurement(2));
  CHECK(exchange.read(no_time) == Read::fresh);
  CHECK(exchange.newest().sequence == 3);
  CHECK(exchange.time() == 4 * period);
  CHECK(exchange.read(no_time) == Read::again);
}

void another_control_period_is_noticed()
{
  Exchange exchange(period);
  Measurement m = measurement(0);
  exchange.arrived(m);
  CHECK(exchange.read(no_time) == Read::fresh);
  m.sequence = 1;
  m.stamp = 2 * period;
  exchange.arrived(m);
  CHECK(exchange.read(no_time) == Read::wrong_period);
}

struct Case
{
  const char * name;
  void (*run)();
};

constexpr Case cases[] = {
  {"one_answer_for_each_measurement", one_answer_for_each_measurement},
  {"read_waits_for_the_next_measurement", read_waits_for_the_next_measurement},
  {"no_command_is_no_answer", no_command_is_no_answer},
  {"axis_without_a_command_keeps_its_drive", axis_without_a_command_keeps_its_drive},
  {"answer_that_was_lost_is_sent_again", answer_that_was_lost_is_sent_again},
  {"reset_begins_a_run_and_time_goes_on", reset_begins_a_run_and_time_goes_on},
  {"newest_measurement_counts", newest_measurement_counts},
  {"another_control_period_is_noticed", another_control_period_is_noticed},
};
}  // namespace

int main(int argc, char ** argv)
{
  for (const Case & each : cases) {
    if (argc == 2 && std::strcmp(argv[1], each.name) == 0) {
      each.run();
      return failures == 0 ? 0 : 1;
    }
  }
  std::printf("there is no such case\n");
  return 2;
}
