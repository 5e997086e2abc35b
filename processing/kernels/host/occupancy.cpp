#include "host/occupancy.hpp"

#include <cstring>

namespace tomoshadow {

OccupiedCells occupied_cells(const int16_t *pixels, int rows, int columns) {
    constexpr int cell_rows = Occupancy::cell_rows, cell_columns = Occupancy::cell_columns;
    const int cells_y = (rows + cell_rows - 1) / cell_rows, cells_x = (columns + cell_columns - 1) / cell_columns;
    const int stride = cells_x + 1;
    std::vector<int32_t> sums(static_cast<size_t>(cells_y + 1) * stride, 0);
    for (int row = 0; row < rows; ++row) {
        const int16_t *line = pixels + static_cast<size_t>(row) * columns;
        int32_t *cells = sums.data() + static_cast<size_t>(row / cell_rows + 1) * stride + 1;
        for (int cell = 0; cell < columns / cell_columns; ++cell) {
            uint64_t words[2];
            std::memcpy(words, line + cell * cell_columns, sizeof words);
            cells[cell] |= (words[0] | words[1]) != 0;
        }
        for (int column = columns / cell_columns * cell_columns; column < columns; ++column)
            cells[column / cell_columns] |= line[column] != 0;
    }
    for (int y = 1; y <= cells_y; ++y) {
        int32_t *line = sums.data() + static_cast<size_t>(y) * stride, along = 0;
        for (int x = 1; x <= cells_x; ++x) line[x] = (along += line[x]) + line[x - stride];
    }
    return {std::move(sums), stride};
}

}  // namespace tomoshadow
