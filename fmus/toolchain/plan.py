"""Pattern of a sparse LU factorisation that never changes, as data of a kernel."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Plan:
    """Pattern of a square matrix and of its factors, rows in order of elimination."""

    order: list[int]  # ``order[i]`` is the unknown that is eliminated at position i
    # row, column, diagonal: factors, compressed by rows: columns ascending, ``diagonal`` the position of each pivot.
    row: list[int]
    column: list[int]
    diagonal: list[int]
    # matrix_row, matrix_column: the matrix itself, in the same order.
    matrix_row: list[int]
    matrix_column: list[int]

    @property
    def entries(self) -> list[tuple[int, int]]:
        """Row and column of each element of the matrix, as they were before the order of elimination."""
        return [
            (self.order[i], self.order[j])
            for i in range(len(self.order))
            for j in self.matrix_column[self.matrix_row[i] : self.matrix_row[i + 1]]
        ]

    def tables(self) -> dict[str, list[int]]:
        return {
            "PERM": self.order,
            "ROW": self.row,
            "COL": self.column,
            "DIAG": self.diagonal,
            "MROW": self.matrix_row,
            "MCOL": self.matrix_column,
        }
