// A click on a column's head sorts by it, another one the other way round; what is no figure goes last.
for (const head of document.querySelectorAll("table.sortable th")) {
  head.addEventListener("click", () => {
    const table = head.closest("table"), column = head.cellIndex;
    const down = head.getAttribute("aria-sort") === "ascending";
    for (const other of table.querySelectorAll("th")) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const rows = [...table.rows].slice(1), text = row => row.cells[column].textContent;
    const numeric = head.classList.contains("number");
    const compare = (a, b) => {
      if (!numeric) return (down ? -1 : 1) * text(a).localeCompare(text(b));
      const [x, y] = [parseFloat(text(a)), parseFloat(text(b))];
      if (isNaN(x) || isNaN(y)) return isNaN(x) - isNaN(y);
      return down ? y - x : x - y;
    };
    rows.sort(compare).forEach(row => row.parentNode.append(row));
  });
}
