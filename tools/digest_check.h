// Whole folders of regression scenes: NAME.cfg beside NAME.digest, run and compared.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/diff_report.h"

namespace varve::tools {

struct SceneCheck {
  std::string name;
  Verdict verdict = Verdict::not_comparable;
  std::string text;  ///< one line: what was found, or why nothing was
  bool blessed = false;
  double seconds = 0;
};

struct CheckOptions {
  std::optional<std::string> bless_reason;  ///< rewrite the digest files instead of comparing
  std::vector<std::string> run_arguments;  ///< handed to varve-run, e.g. "--threads", "4"
};

/// Runs every scene of `folder` that has a digest file, with the varve-run beside this program.
/// Throws UsageError if there is none. The logs go to a scratch folder.
std::vector<SceneCheck> check_scenes(const std::string& folder, const CheckOptions& options);

/// 0 if all agree (or were blessed), 1 if any differs, else 2.
int exit_code(const std::vector<SceneCheck>& scenes);

std::string text_report(const std::vector<SceneCheck>& scenes);
std::string json_report(const std::vector<SceneCheck>& scenes);
/// One suite, one case per scene.
std::string junit_report(const std::vector<SceneCheck>& scenes, const std::string& folder);

}  // namespace varve::tools
