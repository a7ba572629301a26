// Comparisons in which at least one side is a digest file: chains only, at the steps it lists.
#include <algorithm>
#include <memory>

#include <fmt/format.h>

#include "io/errors.h"
#include "tools/cli.h"
#include "tools/diff_run.h"
#include "tools/diff_search.h"
#include "tools/steps.h"

namespace varve::tools {
namespace {

// A run or a digest file, as far as chains go.
struct Side {
  const io::LogReader* log = nullptr;
  const DigestFile* file = nullptr;
  DigestFile head;  ///< of a run: its inputs, without lines

  explicit Side(const DigestFile& f) : file(&f) {}
  explicit Side(const io::LogReader& l) : log(&l) {
    const io::Genesis& genesis = l.genesis();
    head.engine = genesis.engine;
    head.engine_revision = genesis.engine_revision;
    head.scenario = scenario_digest(genesis);
    head.schema = io::chain_base(genesis.schema);
    head.parameters = genesis.parameters;
  }

  const DigestFile& inputs() const { return file != nullptr ? *file : head; }
  std::uint64_t first() const { return file != nullptr ? file->first_step() : log->first_step(); }
  std::uint64_t last() const { return file != nullptr ? file->last_step() : log->last_step(); }
  std::optional<DigestLine> at(std::uint64_t step) const {
    if (file != nullptr) {
      const DigestLine* line = file->find(step);
      return line != nullptr ? std::optional(*line) : std::nullopt;
    }
    const auto header = log->header(step);
    if (!header) return {};
    return DigestLine{header->step, header->time, header->chain};
  }
};

void check_inputs(const Side& a, const Side& b, DiffReport& report) {
  const DigestFile &x = a.inputs(), &y = b.inputs();
  if (x.engine != y.engine)
    report.reasons.push_back(fmt::format("a is of engine {}, b of engine {}", x.engine, y.engine));
  else if (x.engine_revision != y.engine_revision)
    report.reasons.push_back(fmt::format("a is of engine revision {}, b of revision {}",
                                         x.engine_revision, y.engine_revision));
  if (x.schema != y.schema) report.reasons.push_back("the fields of the state are not the same");
  if (x.scenario == y.scenario) return;
  bool matters = x.parameters.empty() || y.parameters.empty();
  for (const KeyDifference& d : compare_keys(x.parameters, y.parameters)) {
    report.genesis.push_back({"parameter", d.key, d.a, d.b});
    if (is_output_key(d.key)) continue;
    matters = true;
    report.reasons.push_back(fmt::format("{}: a={} b={}", d.key, d.a, d.b));
  }
  // Scenarios that differ in nothing but what is recorded, or in how they are spelt, compare.
  if (report.genesis.empty()) matters = true;
  if (matters && report.reasons.empty())
    report.reasons.push_back(fmt::format("the scenarios differ (digests {} and {})",
                                         x.scenario.hex(), y.scenario.hex()));
}

// The listed steps within the range that is asked for and that both sides reach.
std::vector<std::uint64_t> listed_steps(const Side& a, const Side& b, std::uint64_t from,
                                        std::uint64_t to) {
  std::vector<std::uint64_t> steps;
  const DigestFile& list = a.file != nullptr ? *a.file : *b.file;
  const Side& other = a.file != nullptr ? b : a;
  for (const DigestLine& line : list.lines) {
    if (line.step < from || line.step > to) continue;
    if (other.file == nullptr || other.file->find(line.step) != nullptr) steps.push_back(line.step);
  }
  return steps;
}

std::uint64_t limit(const Side& a, const Side& b, const std::string& text,
                    const std::string& option) {
  if (a.log != nullptr || b.log != nullptr)
    return parse_step(text, a.log != nullptr ? *a.log : *b.log);
  if (text.empty() || text.size() > 18 || text.find_first_not_of("0123456789") != text.npos)
    throw UsageError(fmt::format("{}: '{}': between two digest files only a step's number will do",
                                 option, text));
  return std::stoull(text);
}

// A reference that the other side does not reach is not met, whatever the steps before say.
void check_reach(const Side& file, const Side& other, std::uint64_t to, char name,
                 DiffReport& report) {
  const auto end = std::find_if(file.file->lines.rbegin(), file.file->lines.rend(),
                                [&](const DigestLine& line) { return line.step <= to; });
  if (end == file.file->lines.rend() || end->step <= other.last()) return;
  report.reasons.push_back(fmt::format(
      "{} ends at step {}, the digest file asks for step {} (--to {} compares what both hold)",
      name, other.last(), end->step, other.last()));
}

void search(const Side& a, const Side& b, const std::vector<std::uint64_t>& steps,
            DiffReport& report) {
  const ChainSearch found =
      search_chains(0, steps.size() - 1, [&](std::uint64_t i) -> std::optional<bool> {
        const auto x = a.at(steps[i]);
        if (!x) return {};
        const auto y = b.at(steps[i]);
        if (!y) return {};
        return x->chain == y->chain;
      });
  if (a.log != nullptr) report.header_reads_a = a.log->header_reads();
  if (b.log != nullptr) report.header_reads_b = b.log->header_reads();
  if (a.log != nullptr) require_whole(*a.log);
  if (b.log != nullptr) require_whole(*b.log);
  report.from = steps.front();
  report.to = steps.back();
  report.steps_compared = steps.size();
  if (!found.any_step) {
    report.reasons.push_back("the listed steps are lost in the run");
  } else if (!found.first_unequal) {
    report.chain = a.at(steps[found.last_held])->chain.hex();
  } else {
    FirstDifference first;
    first.step = steps[*found.first_unequal];
    first.time = a.at(first.step)->time;
    if (found.last_equal)
      first.last_equal = steps[*found.last_equal];
    else if (first.step > std::min(a.first(), b.first()))
      report.notes.push_back("the first compared step differs: the difference may begin before it");
    first.why_no_field = "field unknown: a digest file holds no states";
    report.verdict = Verdict::different;
    report.first = std::move(first);
  }
}

DiffReport compare_sides(const Side& a, const Side& b, const std::string& name_a,
                         const std::string& name_b, const DiffOptions& options) {
  if (options.tolerances.given() || !options.fields.empty())
    throw UsageError("tolerances and --fields need states: a digest file holds none");
  DiffReport report;
  report.a = name_a;
  report.b = name_b;
  check_inputs(a, b, report);
  const std::uint64_t from = options.from ? limit(a, b, *options.from, "--from") : 0;
  const std::uint64_t to = options.to ? limit(a, b, *options.to, "--to") : ~std::uint64_t{0};
  if (a.file != nullptr) check_reach(a, b, to, 'b', report);
  if (b.file != nullptr) check_reach(b, a, to, 'a', report);
  const std::vector<std::uint64_t> steps = listed_steps(
      a, b, std::max({from, a.first(), b.first()}), std::min({to, a.last(), b.last()}));
  if (steps.empty()) report.reasons.push_back("no listed step is held by both");
  if (report.reasons.empty()) search(a, b, steps, report);
  if (!report.reasons.empty()) report.verdict = Verdict::not_comparable;
  return report;
}

}  // namespace

DiffReport compare_with_digests(const io::LogReader& run, const DigestFile& file,
                                const DiffOptions& options) {
  return compare_sides(Side(run), Side(file), run.path(), file.path, options);
}

DiffReport compare_inputs(const std::string& path_a, const std::string& path_b,
                          const DiffOptions& options) {
  std::optional<DigestFile> file_a, file_b;
  std::unique_ptr<io::LogReader> log_a, log_b;
  if (is_digest_file(path_a))
    file_a = read_digest_file(path_a);
  else
    log_a = open_whole(path_a);
  if (is_digest_file(path_b))
    file_b = read_digest_file(path_b);
  else
    log_b = open_whole(path_b);
  if (log_a && log_b) return compare_logs(*log_a, *log_b, options);
  const Side a = file_a ? Side(*file_a) : Side(*log_a);
  const Side b = file_b ? Side(*file_b) : Side(*log_b);
  return compare_sides(a, b, path_a, path_b, options);
}

}  // namespace varve::tools
