!> Composite families: bonds within a grid are those of its lattice, bonds between grids, and those
!> of points on no grid, are in a list. The list has slots of its own, for the points that have such
!> bonds alone.
module pd_family_composite
  use pd_base_archive, only: archive_type
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_text, only: to_text
  use pd_body_body, only: allocate_points, body_type
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  use pd_family_lattice, only: both_ends, grid_at, grids_fit, lattice_family_type, &
    & new_lattice_family
  use pd_family_list, only: list_family_type, new_list_family
  use pd_family_volume, only: volume_rule_type
  implicit none (type, external)
  private
  public :: composite_family_type, composite_suits, new_composite_family

  !> Part of the points that may have bonds in the list: beyond it one list of all is as fast.
  real(wp), parameter :: most_listed = 0.5_wp

  type, extends(family_type) :: composite_family_type
    type(lattice_family_type) :: lattice       !! its slots are those of the family
    type(list_family_type) :: list             !! with slots of its own
    integer(i4), allocatable :: slot(:)        !! of each live slot of the list, its slot here
    integer(i4), allocatable :: place(:)       !! of each slot, its slot of the list; 0: has none
    integer :: first_free = 0                  !! the first slot behind the grids
    ! of substeps, for which each bond has a level, and each point's dilatation
    integer :: levels = 0                      !! the finest one; 0: there are no substeps
    integer(i1), allocatable :: own_level(:)   !! of each slot, that of its dilatation
    integer(i1), allocatable :: bond_level(:)  !! of each slot, that of the lattice's bonds which
                                               !! its block computes
    integer(i1), allocatable :: grid_level(:)  !! of each slot, that of its spacing
  contains
    procedure :: bonds_of
    procedure :: break_bond
    procedure :: keep_bonds
    procedure :: bytes
    procedure :: describe
    procedure :: alike
    procedure :: may_have_broken
    procedure :: bytes_are_shared
    procedure :: level_of_bond
    procedure :: has_level
    procedure :: give_levels
  end type composite_family_type

contains

  !> Whether the grids of a body can have lattices that a list joins, and few enough points have
  !> bonds in that. Otherwise `reason` says why not.
  subroutine composite_suits(body, rule, listed, suits, reason)
    type(body_type), intent(in) :: body         !! in point order, not yet arranged in slots
    type(volume_rule_type), intent(in) :: rule  !! how far families reach
    logical, intent(in) :: listed(:)            !! (n_points) from `find_listed`
    logical, intent(out) :: suits               !! a composite family can be made
    character(:), allocatable, intent(out) :: reason
      !! why not, without a full stop; empty if it suits

    suits = .false.
    if (all(body%grid == 0)) then
      reason = 'no point is on a grid'
    else if (count(listed) > most_listed*body%n_points) then
      reason = 'too many points have bonds beyond their grid'
    else
      call grids_fit(body, rule, suits, reason)
    end if
  end subroutine composite_suits

  !> Families of a body that `composite_suits`; the body is arranged in slots: those of its grids,
  !> and behind them those of points on no grid. An error is set where the lattices cannot be made.
  subroutine new_composite_family(body, rule, listed, breakable, family, error)
    type(body_type), intent(inout) :: body
      !! in point order; arranged in the slots of the family on return
    type(volume_rule_type), intent(in) :: rule         !! volume correction and horizon
    logical, intent(in) :: listed(:)                   !! (n_points) from `find_listed`
    logical, intent(in) :: breakable                   !! bonds may break or be cut
    type(composite_family_type), intent(out) :: family !! whole, all bonds intact
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: joint
    integer(i4), allocatable :: chosen(:)
    integer :: k, n

    n = count(listed)
    chosen = pack([(int(k, i4), k=1, body%n_points)], listed)
    call allocate_points(joint, body%dim, n)
    joint%x = body%x(chosen, :)
    joint%volume = body%volume(chosen)
    joint%spacing = body%spacing(chosen)
    joint%body = body%body(chosen)
    joint%material = body%material(chosen)
    joint%grid = body%grid(chosen)
    call new_list_family(joint, rule, family%list, apart=.true.)
    call new_lattice_family(body, rule, breakable, .false., family%lattice, error, listed=listed)
    if (allocated(error)) return
    family%dim = body%dim
    family%n_slots = body%n_slots
    family%rule = rule
    family%slot = body%slot(chosen(joint%point(:n)))
    allocate (family%place(body%n_slots), source=0_i4)
    do k = 1, n
      family%place(family%slot(k)) = int(k, i4)
    end do
    associate (grids => family%lattice%grids)
      family%first_free = int(grids(size(grids))%last) + 1
    end associate
    family%n_bonds = family%lattice%n_bonds + family%list%n_bonds
    family%most_bonds = family%lattice%most_bonds
    do k = 1, n
      family%most_bonds = max(family%most_bonds, family%lattice%number_at(family%slot(k)) &
        & + family%list%number_at(k))
    end do
  end subroutine new_composite_family

  !> All bonds of slot `k`: those of its lattice, then those of the list; broken ones too.
  pure subroutine bonds_of(family, k, bonds)
    class(composite_family_type), intent(in) :: family  !! the family
    integer, intent(in) :: k                            !! slot; a dead one has no bonds
    type(bonds_type), intent(inout) :: bonds
      !! made by `allocate_bonds`; the first `bonds%n` entries are set
    type(bonds_type) :: more
    integer :: n

    call family%lattice%bonds_of(k, bonds)
    if (family%place(k) == 0_i4) return
    call allocate_bonds(family%list, more)
    call family%list%bonds_of(int(family%place(k)), more)
    n = bonds%n
    bonds%n = n + more%n
    bonds%j(n + 1:bonds%n) = family%slot(more%j(:more%n))
    bonds%xi(n + 1:bonds%n, :) = more%xi(:more%n, :)
    bonds%length(n + 1:bonds%n) = more%length(:more%n)
    bonds%weight(n + 1:bonds%n) = more%weight(:more%n)
    bonds%intact(n + 1:bonds%n) = more%intact(:more%n)
  end subroutine bonds_of

  !> Break the `i`-th bond of slot `k`; the other direction is another call.
  pure subroutine break_bond(family, k, i)
    class(composite_family_type), intent(inout) :: family  !! with this bond broken on return
    integer, intent(in) :: k                               !! slot whose bond is broken
    integer, intent(in) :: i  !! number of the bond in `bonds_of(k)`, from 1
    integer :: n

    n = family%lattice%number_at(k)
    if (i <= n) then
      call family%lattice%break_bond(k, i)
    else
      call family%list%break_bond(int(family%place(k)), i - n)
    end if
  end subroutine break_bond

  !> Keep which bonds are broken, or put it back.
  subroutine keep_bonds(family, archive)
    class(composite_family_type), intent(inout) :: family
      !! its broken bonds are set where the archive reads
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read

    if (allocated(family%lattice%broken)) call family%lattice%keep_bonds(archive)
    call family%list%keep_bonds(archive)
  end subroutine keep_bonds

  !> Memory of both parts [bytes].
  pure integer(i8) function bytes(family)
    class(composite_family_type), intent(in) :: family  !! the family
    bytes = family%lattice%bytes() + family%list%bytes() + 4_i8*size(family%place) &
      & + 4_i8*size(family%slot)
  end function bytes

  !> The grids, and how much is in the list, in a line.
  function describe(family) result(text)
    class(composite_family_type), intent(in) :: family  !! the family
    character(:), allocatable :: text

    text = family%lattice%describe()//', and a list of the '// &
      & to_text(100*real(family%list%n_bonds, wp)/max(1_i8, family%n_bonds), 2)// &
      & ' % of the bonds that join grids'
    if (any(family%place(family%first_free:) > 0_i4)) text = text//' or points on none'
  end function describe

  !> A slot with the same bonds: one without bonds in the list, of the same class of its lattice.
  pure integer function alike(family, k)
    class(composite_family_type), intent(in) :: family  !! the family
    integer, intent(in) :: k                            !! slot
    alike = k
    if (family%place(k) == 0_i4) alike = family%lattice%alike(k)
  end function alike

  !> Whether some bond of slot `k` is broken.
  pure logical function may_have_broken(family, k)
    class(composite_family_type), intent(in) :: family  !! the family
    integer, intent(in) :: k                            !! slot
    may_have_broken = family%lattice%may_have_broken(k)
    if (family%place(k) > 0_i4) may_have_broken = may_have_broken .or. &
      & family%list%may_have_broken(int(family%place(k)))
  end function may_have_broken

  !> Bonds of slots that lie far apart may share a byte of the list.
  pure logical function bytes_are_shared(family)
    class(composite_family_type), intent(in) :: family  !! the family
    bytes_are_shared = size(family%slot) > 0
  end function bytes_are_shared

  !> The level of the step that the bond of slots `k` and `j` takes, 0 without substeps: bonds of
  !> the list take the finest.
  pure integer function level_of_bond(family, k, j)
    class(composite_family_type), intent(in) :: family  !! the family
    integer, intent(in) :: k                            !! slot of one end
    integer, intent(in) :: j                            !! slot of the other end

    level_of_bond = 0
    if (family%levels == 0) return
    level_of_bond = family%levels
    if (max(k, j) >= family%first_free) return
    if (grid_at(family%lattice, int(k, i8)) /= grid_at(family%lattice, int(j, i8))) return
    ! loops that add to both ends compute a bond where its first slot is
    level_of_bond = family%bond_level(min(k, j))
  end function level_of_bond

  !> Whether slot `k` may have bonds of a level of substeps: of that of its grid, or of the finest.
  pure logical function has_level(family, k, level)
    class(composite_family_type), intent(in) :: family  !! the family
    integer, intent(in) :: k                            !! slot
    integer, intent(in) :: level                        !! 0 or above
    has_level = level == family%levels
    if (family%levels > 0) has_level = has_level .or. level == int(family%grid_level(k))
  end function has_level

  !> Give bonds and points the levels of substeps (doc/theory.md, 5). Those of the list have the
  !> finest; so has the dilatation of every point with a bond there, and every block of the lattice
  !> that computes a bond of such a point. All others have the level of their grid.
  pure subroutine give_levels(family, of_grid, part)
    class(composite_family_type), intent(inout) :: family  !! whole; has levels on return
    integer, intent(in) :: of_grid(:)  !! (grids of the lattice) their levels, from 0
    integer(i1), allocatable, intent(out) :: part(:)
      !! (blocks of the lattice) in which part of the passes each one is: those of the levels; that
      !! of the finest level has the blocks of coarser grids alone, the blocks of its own grids
      !! follow in a part behind
    type(bonds_type) :: bonds
    integer(i4), allocatable :: block_at(:)
    integer :: b, k, i, m

    family%levels = maxval(of_grid)
    allocate (part(size(family%lattice%block)), block_at(family%n_slots))
    if (allocated(family%own_level)) &
      & deallocate (family%own_level, family%bond_level, family%grid_level)
    allocate (family%grid_level(family%n_slots), source=int(family%levels, i1))
    block_at = 0_i4
    associate (lattice => family%lattice)
      do b = 1, size(part)
        associate (first => lattice%block(b), last => lattice%block(b) + lattice%block_length - 1)
          part(b) = int(of_grid(grid_at(lattice, first)), i1)
          family%grid_level(first:last) = part(b)
          block_at(first:last) = int(b, i4)
          if (part(b) == family%levels) part(b) = part(b) + 1_i1
        end associate
      end do
      family%own_level = family%grid_level
      if (both_ends(family%dim, lattice%mixed)) then
        call allocate_bonds(lattice, bonds)
        do i = 1, size(family%slot)
          k = family%slot(i)
          family%own_level(k) = int(family%levels, i1)
          if (k >= family%first_free) cycle
          call lattice%bonds_of(k, bonds)
          do m = 1, bonds%n
            b = block_at(min(k, int(bonds%j(m))))
            part(b) = max(int(family%levels, i1), part(b))
          end do
        end do
      end if
      allocate (family%bond_level(family%n_slots), source=int(family%levels, i1))
      do b = 1, size(part)
        associate (first => lattice%block(b), last => lattice%block(b) + lattice%block_length - 1)
          family%bond_level(first:last) = min(part(b), int(family%levels, i1))
        end associate
      end do
    end associate
  end subroutine give_levels

end module pd_family_composite
