#include "host/parallel.hpp"

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace tomoshadow {

void for_each(int count, int threads, const std::function<void(int)> &work) {
    std::atomic<int> next{0};
    const auto share = [&] {
        for (int i = next++; i < count; i = next++) work(i);
    };
    std::vector<std::thread> others;
    for (int thread = 1; thread < std::min(threads, count); ++thread) others.emplace_back(share);
    share();
    for (std::thread &other : others) other.join();
}

void for_rows(int rows, int threads, const std::function<void(int, int)> &work) {
    constexpr int at_once = 16;
    for_each((rows + at_once - 1) / at_once, threads,
             [&](int chunk) { work(chunk * at_once, std::min(rows, (chunk + 1) * at_once)); });
}

}  // namespace tomoshadow
