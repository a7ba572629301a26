#include "tools/family.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include <fmt/format.h>

#include "io/errors.h"
#include "tools/cli.h"
#include "tools/steps.h"

namespace varve::tools {

namespace fs = std::filesystem;

namespace {

std::unique_ptr<io::LogReader> open_if_log(const std::string& path) {
  try {
    return io::LogReader::open(path);
  } catch (const io::LogError&) {
    return nullptr;  // some other file, or too damaged to be of use
  }
}

/// Equal run ids alone do not tell a whole parent from one that was stopped before the fork.
bool is_parent(const io::LogReader& candidate, const io::Lineage& lineage) {
  if (candidate.genesis().run_id() != lineage.parent_run_id) return false;
  const auto header = candidate.header(lineage.step);
  return header && header->chain == lineage.parent_chain;
}

std::unique_ptr<io::LogReader> find_in(const std::string& folder, const io::Lineage& lineage,
                                       const std::string& except) {
  for (const std::string& path : logs_in(folder)) {
    if (path == except) continue;
    auto candidate = open_if_log(path);
    if (candidate && is_parent(*candidate, lineage)) return candidate;
  }
  return nullptr;
}

std::string folder_of(const std::string& path) {
  const fs::path parent = fs::path(path).parent_path();
  return parent.empty() ? "." : parent.string();
}

}  // namespace

std::vector<std::string> logs_in(const std::string& folder) {
  std::vector<std::string> paths;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code unreadable;
    if (entry->is_regular_file(unreadable) && open_if_log(entry->path().string()))
      paths.push_back(entry->path().string());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

std::unique_ptr<io::LogReader> open_parent(const io::LogReader& child,
                                           const std::optional<std::string>& parent_option) {
  const auto& lineage = child.genesis().lineage;
  if (!lineage) return nullptr;
  const std::string folder = folder_of(child.path());
  if (parent_option && !fs::is_directory(*parent_option)) {
    auto named = io::LogReader::open(*parent_option);
    if (is_parent(*named, *lineage)) return named;
    // The option may name a more distant ancestor; the nearer ones are then beside the child.
    const auto& ancestors = lineage->ancestors;
    const std::string id = named->genesis().run_id();
    if (std::find(ancestors.begin(), ancestors.end(), id) == ancestors.end() ||
        id == lineage->parent_run_id)
      throw UsageError(fmt::format("{}: not the parent of {}: run {} with step {} is",
                                   *parent_option, child.path(), lineage->parent_run_id,
                                   lineage->step));
  }
  if (parent_option && fs::is_directory(*parent_option))
    if (auto found = find_in(*parent_option, *lineage, child.path())) return found;
  if (!lineage->parent_name.empty() && lineage->parent_name.find('/') == std::string::npos) {
    const std::string path = (fs::path(folder) / lineage->parent_name).string();
    auto hinted = path == child.path() ? nullptr : open_if_log(path);
    if (hinted && is_parent(*hinted, *lineage)) return hinted;
  }
  return find_in(folder, *lineage, child.path());
}

std::unique_ptr<io::LogReader> open_holder(std::unique_ptr<io::LogReader> run, std::uint64_t step,
                                           const std::optional<std::string>& parent_option) {
  while (step < run->first_step()) {
    auto parent = open_parent(*run, parent_option);
    if (!parent) {
      const auto& lineage = run->genesis().lineage;
      throw io::LogError(
          io::ErrorKind::not_found, run->path(),
          lineage ? fmt::format("begins at step {}; step {} is in its parent {} (run {}), which is "
                                "not beside it: name it with --parent",
                                run->first_step(), step, lineage->parent_name,
                                lineage->parent_run_id)
                  : fmt::format("begins at step {}, there is no step {}", run->first_step(), step));
    }
    run = std::move(parent);
  }
  if (!run->header(step))
    throw io::LogError(io::ErrorKind::not_found, run->path(),
                       fmt::format("holds no step {}; its steps are {} to {}", step,
                                   run->first_step(), run->last_step()));
  return run;
}

Place open_at(std::unique_ptr<io::LogReader> run, const std::string& text,
              const std::optional<std::string>& parent_option) {
  if (text.starts_with("t=")) {
    const double seconds = parse_seconds(std::string_view(text).substr(2), "--at");
    for (auto first = run->header(run->first_step());
         first && run->genesis().lineage && seconds < first->time - 1e-6 * first->dt;
         first = run->header(run->first_step())) {
      auto parent = open_parent(*run, parent_option);
      if (!parent) break;
      run = std::move(parent);
    }
    const std::uint64_t step = parse_step(text, *run);
    return {std::move(run), step};
  }
  const std::uint64_t step = parse_step(text, *run, true);
  return {open_holder(std::move(run), step, parent_option), step};
}

void warn_if_incomplete(const io::LogReader& log) {
  if (log.completeness() == io::Completeness::torn)
    warn(fmt::format("{}: torn: {} bytes behind step {} are no whole record (varve resume cuts "
                     "them)", log.path(), log.torn_bytes(), log.last_step()));
  if (log.completeness() == io::Completeness::damaged)
    warn(fmt::format("{}: damaged: varve verify says where, varve recover saves what is whole",
                     log.path()));
}

}  // namespace varve::tools
