#include "host/parallel.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <new>
#include <thread>
#include <vector>

#include "job.hpp"

namespace tomoshadow {

void out_of_memory() { throw std::bad_alloc(); }

void for_each(int count, int threads, const std::function<void(int)> &work) {
    std::atomic<int> next{0};
    std::atomic_flag failed = ATOMIC_FLAG_INIT;
    std::exception_ptr failure;
    const auto share = [&] {
        try {
            for (int i = next++; i < count; i = next++) work(i);
        } catch (...) {
            next = count;
            if (!failed.test_and_set()) failure = std::current_exception();
        }
    };
    std::vector<std::thread> others;
    try {
        others.reserve(static_cast<size_t>(threads));
        for (int thread = 1; thread < std::min(threads, count); ++thread) others.emplace_back(share);
    } catch (...) {  // of no memory or no thread: those that there are do the work
    }
    share();
    for (std::thread &other : others) other.join();
    if (failure) std::rethrow_exception(failure);
}

void for_rows(int rows, int threads, const std::function<void(int, int)> &work) {
    constexpr int at_once = 16;
    for_each((rows + at_once - 1) / at_once, threads,
             [&](int chunk) { work(chunk * at_once, std::min(rows, (chunk + 1) * at_once)); });
}

}  // namespace tomoshadow
