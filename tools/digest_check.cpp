#include "tools/digest_check.h"

#include <algorithm>
#include <chrono>
#include <filesystem>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "io/errors.h"
#include "tools/cli.h"
#include "tools/diff_run.h"
#include "tools/digest_file.h"
#include "tools/scratch_folder.h"
#include "tools/subprocess.h"

namespace varve::tools {
namespace {

namespace fs = std::filesystem;
using json = nlohmann::ordered_json;

std::vector<std::string> scenes_in(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error))
    if (at->path().extension() == ".digest") names.push_back(at->path().stem().string());
  if (error) throw UsageError(fmt::format("{}: {}", folder, error.message()));
  if (names.empty())
    throw UsageError(
        fmt::format("{}: holds no NAME.digest; 'varve digest RUN -o {}/NAME.digest' "
                    "writes one beside NAME.cfg",
                    folder, folder));
  std::sort(names.begin(), names.end());
  return names;
}

void compare_or_bless(const std::string& log_path, const std::string& digest_path,
                      const CheckOptions& options, SceneCheck& out) {
  const auto log = open_whole(log_path);
  const DigestFile file = read_digest_file(digest_path);
  const DiffReport report = compare_with_digests(*log, file, {});
  out.verdict = report.verdict;
  out.text = headline(report);
  if (!options.bless_reason) return;
  DigestFile blessed = make_digest_file(*log, file.every);
  blessed.reason = *options.bless_reason;
  write_digest_file(blessed, digest_path, true);
  out.text = fmt::format("rewritten ({}); before: {}", *options.bless_reason, out.text);
  out.blessed = true;
}

SceneCheck check_scene(const std::string& folder, const std::string& name,
                       const CheckOptions& options, const ScratchFolder& scratch) {
  SceneCheck out;
  out.name = name;
  const auto start = std::chrono::steady_clock::now();
  const std::string scene = (fs::path(folder) / (name + ".cfg")).string();
  const std::string log = scratch.file("run.varve"), messages = scratch.file("messages");
  try {
    if (!fs::exists(scene)) {
      out.text = fmt::format("{} is missing", scene);
    } else {
      std::vector<std::string> words{executable_folder() + "/varve-run",
                                     scene,
                                     "-o",
                                     log,
                                     "--overwrite",
                                     "--quiet",
                                     "--progress",
                                     "none"};
      words.insert(words.end(), options.run_arguments.begin(), options.run_arguments.end());
      const ProgramResult result = run_program(words, messages);
      if (result.code == exit_ok)
        compare_or_bless(log, (fs::path(folder) / (name + ".digest")).string(), options, out);
      else
        out.text =
            fmt::format("the run ended with exit code {}: {}", result.code, result.last_line);
    }
  } catch (const io::LogError& error) {
    out.text = error.what();
  }
  out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return out;
}

bool passed(const SceneCheck& scene) { return scene.blessed || exit_code(scene.verdict) == 0; }

std::string word_of(const SceneCheck& scene) {
  return scene.blessed ? "blessed" : std::string(name_of(scene.verdict));
}

}  // namespace

std::vector<SceneCheck> check_scenes(const std::string& folder, const CheckOptions& options) {
  const ScratchFolder scratch;
  std::vector<SceneCheck> out;
  for (const std::string& name : scenes_in(folder))
    out.push_back(check_scene(folder, name, options, scratch));
  return out;
}

int exit_code(const std::vector<SceneCheck>& scenes) {
  int code = exit_ok;
  for (const SceneCheck& scene : scenes) {
    if (passed(scene)) continue;
    if (scene.verdict == Verdict::different) return exit_differ;
    code = exit_usage;
  }
  return code;
}

std::string text_report(const std::vector<SceneCheck>& scenes) {
  std::string out;
  for (const SceneCheck& scene : scenes)
    out += fmt::format("{:<24} {:<14} {}\n", scene.name, word_of(scene), scene.text);
  const auto good = std::count_if(scenes.begin(), scenes.end(), passed);
  return out + fmt::format("{} of {} scenes {}\n", good, scenes.size(),
                           scenes.front().blessed ? "rewritten" : "agree with their digests");
}

std::string json_report(const std::vector<SceneCheck>& scenes) {
  json out{{"schema", "varve.digest.check/1"},
           {"verdict", exit_code(scenes) == exit_ok       ? "identical"
                       : exit_code(scenes) == exit_differ ? "different"
                                                          : "not_comparable"},
           {"scenes", json::array()}};
  for (const SceneCheck& scene : scenes)
    out["scenes"].push_back({{"name", scene.name},
                             {"verdict", name_of(scene.verdict)},
                             {"blessed", scene.blessed},
                             {"text", scene.text},
                             {"seconds", scene.seconds}});
  return out.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

std::string junit_report(const std::vector<SceneCheck>& scenes, const std::string& folder) {
  const auto failures = static_cast<std::size_t>(
      std::count_if(scenes.begin(), scenes.end(), [](const SceneCheck& s) { return !passed(s); }));
  double seconds = 0;
  for (const SceneCheck& scene : scenes) seconds += scene.seconds;
  std::string out = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
  out += fmt::format("<testsuites tests=\"{}\" failures=\"{}\">\n", scenes.size(), failures);
  out += fmt::format(
      "  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"0\" time=\"{:.3f}\">\n",
      xml_escape("varve digest " + folder), scenes.size(), failures, seconds);
  for (const SceneCheck& scene : scenes) {
    out += fmt::format("    <testcase classname=\"varve.digest\" name=\"{}\" time=\"{:.3f}\"",
                       xml_escape(scene.name), scene.seconds);
    if (passed(scene))
      out += "/>\n";
    else
      out += fmt::format(">\n      <failure type=\"{}\" message=\"{}\"/>\n    </testcase>\n",
                         name_of(scene.verdict), xml_escape(scene.text));
  }
  return out + "  </testsuite>\n</testsuites>\n";
}

}  // namespace varve::tools
