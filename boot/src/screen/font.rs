//! The letters of the screen, drawn for this project: the 95 visible characters of ASCII, from the
//! blank to the tilde, 5 pixels wide and 8 high. The lowest row is for parts below the line.

/// The columns of a letter.
pub const WIDTH: usize = 5;
/// The rows of a letter.
pub const HEIGHT: usize = 8;

const FIRST: u8 = b' ';
const COUNT: usize = 95;
/// The number of letters next to each other in [`DRAWING`], with a column between them.
const ABREAST: usize = 12;

/// Each letter by its columns from the left, the uppermost pixel in the lowest bit.
static LETTERS: [[u8; WIDTH]; COUNT] = letters();

/// Reports whether the pixel in this column and row of a letter is lit. For any byte but a visible
/// character, all pixels are lit.
pub fn is_lit(letter: u8, column: usize, row: usize) -> bool {
    let index = letter.wrapping_sub(FIRST);
    let columns = LETTERS.get(usize::from(index));
    columns.is_none_or(|columns| columns[column] >> row & 1 == 1)
}

const fn letters() -> [[u8; WIDTH]; COUNT] {
    let mut letters = [[0; WIDTH]; COUNT];
    let mut index = 0;
    while index < COUNT {
        let mut pixel = 0;
        while pixel < WIDTH * HEIGHT {
            let (column, row) = (pixel % WIDTH, pixel / WIDTH);
            let line = DRAWING[index / ABREAST * HEIGHT + row];
            if line[index % ABREAST * (WIDTH + 1) + column] == b'#' {
                letters[index][column] |= 1 << row;
            }
            pixel += 1;
        }
        index += 1;
    }
    letters
}

const DRAWING: [&[u8; ABREAST * (WIDTH + 1) - 1]; COUNT.div_ceil(ABREAST) * HEIGHT] = [
    b"        #    # #   # #    #   ##  #  ##     #      #   #               ",
    b"        #    # #   # #   #### ##  # #  #    #     #     #     #     #  ",
    b"        #    # #  ##### # #      #  # #    #     #       #  # # #   #  ",
    b"        #          # #   ###    #    #           #       #   ###  #####",
    b"        #         #####   # #  #    # # #        #       #  # # #   #  ",
    b"                   # #  ####  #  ## #  #          #     #     #     #  ",
    b"        #          # #    #   #  ##  ## #          #   #               ",
    b"                                                                       ",
    b"                      #  ###    #    ###  #####    #  #####   ##  #####",
    b"                      # #   #  ##   #   #    #    ##  #      #        #",
    b"                     #  #  ## # #       #   #    # #  ####  #        # ",
    b"      #####         #   # # #   #     ##     #  #  #      # ####    #  ",
    b"                   #    ##  #   #    #        # #####     # #   #   #  ",
    b"  #          ##   #     #   #   #   #     #   #    #  #   # #   #  #   ",
    b"  #          ##   #      ###  ##### #####  ###     #   ###   ###   #   ",
    b" #                                                                     ",
    b" ###   ###                 #         #     ###   ###    #   ####   ### ",
    b"#   # #   #  ##    ##     #           #   #   # #   #  # #  #   # #   #",
    b"#   # #   #  ##    ##    #    #####    #      # # ### #   # #   # #    ",
    b" ###   ####             #               #    #  # # # #   # ####  #    ",
    b"#   #     #  ##    ##    #    #####    #    #   # ##  ##### #   # #    ",
    b"#   #    #   ##     #     #           #         #     #   # #   # #   #",
    b" ###   ##          #       #         #      #    #### #   # ####   ### ",
    b"                                                                       ",
    b"###   ##### #####  ###  #   #  ###    ### #   # #     #   # #   #  ### ",
    b"#  #  #     #     #   # #   #   #      #  #  #  #     ## ## ##  # #   #",
    b"#   # #     #     #     #   #   #      #  # #   #     # # # ##  # #   #",
    b"#   # ####  ####  # ### #####   #      #  ##    #     # # # # # # #   #",
    b"#   # #     #     #   # #   #   #      #  # #   #     #   # #  ## #   #",
    b"#  #  #     #     #   # #   #   #   #  #  #  #  #     #   # #  ## #   #",
    b"###   ##### #      #### #   #  ###   ##   #   # ##### #   # #   #  ### ",
    b"                                                                       ",
    b"####   ###  ####   #### ##### #   # #   # #   # #   # #   # #####  ### ",
    b"#   # #   # #   # #       #   #   # #   # #   # #   # #   #     #  #   ",
    b"#   # #   # #   # #       #   #   # #   # #   #  # #   # #     #   #   ",
    b"####  #   # ####   ###    #   #   #  # #  # # #   #     #     #    #   ",
    b"#     # # # # #       #   #   #   #  # #  # # #  # #    #    #     #   ",
    b"#     #  #  #  #      #   #   #   #   #   ## ## #   #   #   #      #   ",
    b"#      ## # #   # ####    #    ###    #   #   # #   #   #   #####  ### ",
    b"                                                                       ",
    b"#      ###    #          #          #               #         ##       ",
    b"#        #   # #          #         #               #        #  #      ",
    b" #       #  #   #          #   ###  ####   ####  ####  ###   #     ####",
    b"  #      #                        # #   # #     #   # #   # ####  #   #",
    b"   #     #                     #### #   # #     #   # #####  #    #   #",
    b"    #    #                    #   # #   # #     #   # #      #     ####",
    b"    #  ###                     #### ####   ####  ####  ####  #        #",
    b"                  #####                                            ### ",
    b"#       #      #  #      ##                                            ",
    b"#                 #       #                                            ",
    b"####   ##     ##  #  #    #   ## #  ####   ###  ####   #### # ##   ####",
    b"#   #   #      #  # #     #   # # # #   # #   # #   # #   # ##  # #    ",
    b"#   #   #      #  ##      #   # # # #   # #   # #   # #   # #      ### ",
    b"#   #   #      #  # #     #   # # # #   # #   # ####   #### #         #",
    b"#   #  ###  #  #  #  #   ###  # # # #   #  ###  #         # #     #### ",
    b"             ##                                 #         #            ",
    b" #                                           #    #    #               ",
    b" #                                          #     #     #              ",
    b"####  #   # #   # #   # #   # #   # #####   #     #     #    #         ",
    b" #    #   # #   # # # #  # #  #   #    #   #      #      #  # # #      ",
    b" #    #   #  # #  # # #   #   #   #   #     #     #     #      #       ",
    b" #  # #   #  # #  # # #  # #   ####  #      #     #     #              ",
    b"  ##   ####   #    # #  #   #     # #####    #    #    #               ",
    b"                               ###                                     ",
];

#[cfg(test)]
mod tests {
    use super::{FIRST, HEIGHT, LETTERS, WIDTH, is_lit};

    #[test]
    fn no_two_letters_look_alike() {
        for (index, letter) in LETTERS.iter().enumerate() {
            assert!(!LETTERS[..index].contains(letter), "{index}");
        }
        assert_eq!(LETTERS[0], [0; WIDTH], "the blank");
    }

    #[test]
    fn a_letter_stands_upright() {
        let rows = (0..HEIGHT).map(|row| {
            let pixel = |column| if is_lit(b'F', column, row) { '#' } else { ' ' };
            (0..WIDTH).map(pixel).collect::<String>()
        });
        let drawn = [
            "#####", "#    ", "#    ", "#### ", "#    ", "#    ", "#    ", "     ",
        ];
        assert_eq!(rows.collect::<Vec<_>>(), drawn);
        assert!(is_lit(0, 0, 0) && is_lit(FIRST + 95, 4, 7), "a block");
    }
}
