!> List families for any cloud of points: the two arrays of 7.11, and a flag for each bond.
!>
!> Nothing else is stored per bond: xi, |xi| and v_c come from the points.
module pd_family_list
  use pd_base_archive, only: archive_type
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_body_body, only: body_type, arrange
  use pd_family_cells, only: cells_type, sort_into_cells, collect_neighbours
  use pd_family_family, only: family_type, bonds_type
  use pd_family_volume, only: volume_rule_type, volume_correction, reach, volume_exact
  implicit none (type, external)
  private
  public :: list_family_type, new_list_family

  type, extends(family_type) :: list_family_type
    integer(i8), allocatable :: start(:)       !! first bond of each slot (n_slots + 1)
    integer(i4), allocatable :: neighbour(:)   !! slot at each bond's other end
    integer(i1), allocatable :: intact(:)      !! 1 intact, 0 broken
    real(wp), allocatable :: spacing(:)        !! [m]
    real(wp), allocatable :: fraction(:)       !! v_c per bond, only where it is no simple formula
    logical :: one_spacing = .false.           !! all points have the same
    real(wp), allocatable :: place(:, :)       !! position and volume, point by point (4, n_slots)
    real(wp), allocatable :: moved(:, :)       !! displacement and p, gathered (4, n_slots)
    character(:), allocatable :: reason        !! why this family and no lattice
  contains
    procedure :: bonds_of
    procedure :: break_bond
    procedure :: keep_bonds
    procedure :: bytes
    procedure :: describe
  end type list_family_type

contains

  !> Families of all points of `body`, which is sorted cell by cell so that neighbours are near in
  !> memory. Members are those within the rule's reach for the bond's mean spacing.
  subroutine new_list_family(body, rule, family)
    type(body_type), intent(inout) :: body
    type(volume_rule_type), intent(in) :: rule
    type(list_family_type), intent(out) :: family
    type(cells_type) :: cells
    real(wp), allocatable :: half_reach(:)
    integer :: k

    ! fine cells first: they only order the points
    call sort_into_cells(body%x, 2*maxval(body%spacing), cells)
    call arrange(body, body%point(cells%order))
    family%dim = body%dim
    family%n_slots = body%n_slots
    family%rule = rule
    allocate (half_reach(body%n_slots))
    do k = 1, body%n_slots
      half_reach(k) = reach(rule, body%spacing(k), body%dim)/2
    end do
    call sort_into_cells(body%x, 2*maxval(half_reach), cells)
    call collect_neighbours(body%x, half_reach, cells, family%start, family%neighbour)
    family%n_bonds = size(family%neighbour, kind=i8)
    do k = 1, body%n_slots
      family%most_bonds = max(family%most_bonds, int(family%start(k + 1) - family%start(k)))
    end do
    allocate (family%intact(family%n_bonds), source=1_i1)
    family%spacing = body%spacing
    family%one_spacing = maxval(family%spacing) <= minval(family%spacing)
    allocate (family%place(4, family%n_slots), family%moved(4, family%n_slots), source=0.0_wp)
    do k = 1, family%n_slots
      family%place(:family%dim, k) = body%x(k, :)
      family%place(4, k) = body%volume(k)
    end do
    if (rule%kind == volume_exact) call store_fractions(family)
  end subroutine new_list_family

  !> Keep the covered part of each cell: it is too dear to compute in every step.
  subroutine store_fractions(family)
    type(list_family_type), intent(inout) :: family
    real(wp) :: xi(family%dim)
    integer(i8) :: b
    integer :: k, j

    allocate (family%fraction(family%n_bonds))
    !$omp parallel do schedule(dynamic, 256) default(none) shared(family) private(k, b, j, xi)
    do k = 1, family%n_slots
      do b = family%start(k), family%start(k + 1) - 1
        j = family%neighbour(b)
        xi = family%place(:family%dim, j) - family%place(:family%dim, k)
        family%fraction(b) = volume_correction(family%rule, xi, norm2(xi), &
          & (family%spacing(k) + family%spacing(j))/2)
      end do
    end do
  end subroutine store_fractions

  pure subroutine bonds_of(family, k, bonds)
    class(list_family_type), intent(in) :: family
    integer, intent(in) :: k
    type(bonds_type), intent(inout) :: bonds
    integer :: i, c, j

    bonds%n = int(family%start(k + 1) - family%start(k))
    do i = 1, bonds%n
      j = family%neighbour(family%start(k) + i - 1)
      bonds%j(i) = j
      bonds%intact(i) = family%intact(family%start(k) + i - 1) == 1_i1
      bonds%length(i) = 0.0_wp
      do c = 1, family%dim
        bonds%xi(i, c) = family%place(c, j) - family%place(c, k)
        bonds%length(i) = bonds%length(i) + bonds%xi(i, c)**2
      end do
      bonds%length(i) = sqrt(bonds%length(i))
      if (allocated(family%fraction)) then
        bonds%weight(i) = family%place(4, j)*family%fraction(family%start(k) + i - 1)
      else
        bonds%weight(i) = family%place(4, j)*volume_correction(family%rule, bonds%xi(i, :), &
          & bonds%length(i), (family%spacing(k) + family%spacing(j))/2)
      end if
    end do
  end subroutine bonds_of

  pure subroutine break_bond(family, k, i)
    class(list_family_type), intent(inout) :: family
    integer, intent(in) :: k, i
    family%intact(family%start(k) + i - 1) = 0_i1
  end subroutine break_bond

  subroutine keep_bonds(family, archive)
    class(list_family_type), intent(inout) :: family
    class(archive_type), intent(inout) :: archive
    call archive%keep('intact bonds', family%intact)
  end subroutine keep_bonds

  pure integer(i8) function bytes(family)
    class(list_family_type), intent(in) :: family
    bytes = 5*family%n_bonds + int(family%n_slots, i8)*8*10
    if (allocated(family%fraction)) bytes = bytes + 8*family%n_bonds
  end function bytes

  function describe(family) result(text)
    class(list_family_type), intent(in) :: family
    character(:), allocatable :: text
    text = 'list: the neighbours of every point stored one by one'
    if (allocated(family%reason)) text = text//' ('//family%reason//')'
    if (allocated(family%fraction)) text = text//', with their volume fractions'
  end function describe

end module pd_family_list
