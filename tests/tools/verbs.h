// Scenes that take well under a second, and the verbs as functions, for tests of whole commands.
#pragma once

#include <chrono>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/tools/process.h"

namespace varve::test {

using Json = nlohmann::json;

/// A disc thrown at the floor of a small closed box: it touches after a quarter of the 160 steps.
inline std::string disc_scene(const std::string& more = "") {
  return R"([domain]
width = 1 cm
height = 1.2 cm
[fluid]
viscosity = 0.01 Pa.s
spacing = 1 mm
sound_speed = 1 m/s
[grains]
rows = 1
columns = 1
diameter = 2.5 mm
density = 2000 kg/m3
lowest_y = 1.9 mm
velocity_y = -60 mm/s
[contact]
damping = 0.2
[time]
steps = 160
)" + more;
}

/// Six grains in a narrow box, close enough to touch each other and the floor early.
inline std::string crowd_scene(const std::string& more = "") {
  return R"([domain]
width = 1.2 cm
height = 1.4 cm
[fluid]
spacing = 1 mm
sound_speed = 1 m/s
[grains]
rows = 2
columns = 3
diameter = 2.5 mm
density = 2500 kg/m3
gap = 0.05
jitter = 0.02
lowest_y = 1.6 mm
velocity_y = -60 mm/s
[time]
steps = 120
[record]
keyframe_steps = 32
)" + more;
}

/// A scene that goes on for as long as one likes: two grains sink and lie.
inline std::string long_scene() {
  return R"([domain]
width = 1.6 cm
height = 1.6 cm
[fluid]
viscosity = 0.05 Pa.s
spacing = 1 mm
sound_speed = 1 m/s
[grains]
rows = 1
columns = 2
diameter = 2.5 mm
density = 1500 kg/m3
gap = 0.5
lowest_y = 3 mm
[time]
steps = 1500
[record]
keyframe_steps = 100
)";
}

/// Runs a verb; the test fails with its messages if it does not exit with `code`.
inline CommandResult verb(int code, const std::vector<std::string>& arguments,
                          const std::string& folder = "") {
  std::vector<std::string> words = arguments;
  words[0] = "varve-" + words[0];
  CommandResult result = run_command(words, {folder, {}, ""});
  std::string line;
  for (const std::string& word : arguments) line += word + " ";
  EXPECT_EQ(result.code, code) << line << "\n" << result.output << result.errors;
  return result;
}

/// The same with --json; returns what was printed.
inline Json json_verb(int code, std::vector<std::string> arguments,
                      const std::string& folder = "") {
  arguments.push_back("--json");
  const CommandResult result = verb(code, arguments, folder);
  const Json object = Json::parse(result.output, nullptr, false);
  EXPECT_FALSE(object.is_discarded()) << result.output << result.errors;
  return object.is_discarded() ? Json::object() : object;
}

/// Chain at a step, as varve show prints it.
inline std::string chain_at(const std::string& run, std::uint64_t step) {
  return json_verb(0, {"show", run, "--at", std::to_string(step)})["chain"];
}
inline std::string digest_at(const std::string& run, std::uint64_t step) {
  return json_verb(0, {"show", run, "--at", std::to_string(step)})["digest"];
}

/// A 64-bit integer as our JSON holds it.
inline std::uint64_t whole(const Json& value) { return std::stoull(value.get<std::string>()); }

/// A verb in the background, to be signalled.
class Background {
 public:
  explicit Background(std::vector<std::string> words) {
    words[0] = bin_folder() + "/varve-" + words[0];
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    child_ = fork();
    if (child_ < 0) throw std::runtime_error("fork failed");
    if (child_ > 0) return;
    const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
    dup2(nowhere, STDOUT_FILENO);
    dup2(nowhere, STDERR_FILENO);
    execv(argv[0], argv.data());
    _exit(127);
  }
  ~Background() {
    if (child_ > 0 && !done_) {
      kill(child_, SIGKILL);
      wait();
    }
  }
  Background(const Background&) = delete;
  Background& operator=(const Background&) = delete;

  pid_t pid() const { return child_; }
  void signal(int number) const { kill(child_, number); }
  /// True once it has ended by itself.
  bool ended() {
    int status = 0;
    if (!done_ && waitpid(child_, &status, WNOHANG) == child_) take(status);
    return done_;
  }
  /// Exit code, or 128 + the signal that ended it.
  int wait() {
    int status = 0;
    if (!done_ && waitpid(child_, &status, 0) == child_) take(status);
    return code_;
  }

 private:
  void take(int status) {
    done_ = true;
    code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  pid_t child_ = -1;
  bool done_ = false;
  int code_ = -1;
};

}  // namespace varve::test
